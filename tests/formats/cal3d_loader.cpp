// Loads a skeleton and an animation with the real Cal3D library and prints absolute bone positions at given times.
// Use: cal3d_loader walk.xsf walk.xaf < times; prints per time one line: x y z of every bone, in the order of bones.
#include <cal3d/cal3d.h>

#include <cstdio>
#include <vector>

static int fail(const char *what) {
  std::fprintf(stderr, "%s: %s\n", what, CalError::getLastErrorDescription().c_str());
  return 1;
}

int main(int argc, char **argv) {
  if (argc != 3) return 2;
  CalCoreModel core("walk");
  if (!core.loadCoreSkeleton(argv[1])) return fail(argv[1]);
  const int animation = core.loadCoreAnimation(argv[2]);
  if (animation < 0) return fail(argv[2]);
  double time;
  while (std::scanf("%lf", &time) == 1) {
    CalModel model(&core);  // a fresh one per time: the mixer's clock only runs forward
    model.getMixer()->executeAction(animation, 0.0f, 0.0f, 1.0f, true);  // locks at the last key
    model.getMixer()->updateAnimation(static_cast<float>(time));
    model.getMixer()->updateSkeleton();
    for (CalBone *bone : model.getSkeleton()->getVectorBone()) {
      const CalVector &at = bone->getTranslationAbsolute();
      const CalQuaternion &turn = bone->getRotationAbsolute();
      std::printf("%.9g %.9g %.9g %.9g %.9g %.9g %.9g ", at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w);
    }
    std::printf("\n");
  }
  return 0;
}
