"""Labels while points arrive: frame by frame, in bounded memory, with a skeleton of the markers or without."""
