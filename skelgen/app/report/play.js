// The view that plays: a take (play_take.js) and its skeleton on a canvas, its controls, mouse, touch and keys.
// Nothing is loaded from elsewhere.
(() => {
  const FIELD = Math.tan(15 * Math.PI / 180);  // half the field of view
  const FIRST = {azimuth: 0.5, elevation: 0.2};  // rad, seen half from the side
  const FOGS = 5, HAZE = 0.5;  // steps in which what is deeper fades, and how far
  const REACH = 14;  // px around a marker that the pointer finds
  const CELLS = 10;  // of the floor, along the longer side of what is seen

  const byId = (id) => document.getElementById(`play-${id}`);
  const take = new Take(JSON.parse(byId("data").textContent));
  const canvas = byId("canvas"), slider = byId("slider"), toggle = byId("toggle"), readout = byId("time");
  const pen = canvas.getContext("2d");
  const {nJoints, nMarkers, nFrames, rate} = take;

  let camera, frame = 0, clock = 0, isPlaying = false, pointer = null, inks = null, isAsked = false;

  // ---- From where it is seen.

  function reset() {
    const radius = byId("follow").checked ? take.reach : Math.max(Math.hypot(...extent(take.box)) / 2, take.reach);
    const narrow = Math.min(canvas.clientWidth / canvas.clientHeight, 1);
    camera = {...FIRST, distance: 1.05 * radius / FIELD / narrow, pan: [0, 0, 0]};
    ask();
  }

  function target() {
    const middle = byId("follow").checked ? take.middles[frame] : mean(take.box);
    return middle.map((value, axis) => value + camera.pan[axis]);
  }

  function axesOfView() {
    const {azimuth, elevation} = camera;
    const right = [Math.cos(azimuth), 0, -Math.sin(azimuth)];
    const level = Math.cos(elevation);
    const toward = [level * Math.sin(azimuth), Math.sin(elevation), level * Math.cos(azimuth)];
    return {right, up: cross(toward, right), toward};
  }

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

  function projector() {
    const {right, up, toward} = axesOfView(), middle = target();
    const width = canvas.clientWidth, height = canvas.clientHeight, scale = height / 2 / FIELD;
    return (point) => {
      if (!point) return null;
      const from = point.map((value, axis) => value - middle[axis]);
      const depth = camera.distance - dot(from, toward);
      if (depth < 0.05 * camera.distance) return null;  // behind who looks
      return {x: width / 2 + scale * dot(from, right) / depth, y: height / 2 - scale * dot(from, up) / depth, depth};
    };
  }

  function turn(across, down) {
    camera.azimuth -= 0.008 * across;
    camera.elevation = Math.min(Math.max(camera.elevation + 0.008 * down, -1.55), 1.55);
    ask();
  }

  function shift(across, down) {
    const {right, up} = axesOfView(), scale = camera.distance * FIELD * 2 / canvas.clientHeight;
    camera.pan = camera.pan.map((value, axis) => value - scale * (across * right[axis] - down * up[axis]));
    ask();
  }

  function zoom(factor) {
    camera.distance = Math.min(Math.max(camera.distance * factor, take.typical / 20), take.typical * 40);
    ask();
  }

  // ---- In which colours.

  function chooseInks() {
    const style = getComputedStyle(document.documentElement), cache = new Map();
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    const rgb = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
    const page = rgb(named("raised"));
    const mixed = (name, fog) => {
      const key = `${name} ${fog}`;
      if (!cache.has(key)) {
        const share = HAZE * fog / (FOGS - 1);
        const parts = rgb(named(name)).map((part, index) => Math.round(part + share * (page[index] - part)));
        cache.set(key, `rgb(${parts})`);
      }
      return cache.get(key);
    };
    const limb = (index, fog) => mixed(index < 0 ? "limbless" : `limb${index}`, fog);
    inks = {named: (name) => mixed(name, 0), mixed, limb};
    ask();
  }

  // ---- What is drawn.

  function ask() {
    if (!isAsked) requestAnimationFrame(draw);
    isAsked = true;
  }

  function draw() {
    isAsked = false;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const project = projector(), points = take.pointsAt(frame), radius = radiusOf(height);
    drawFloor(project, points, radius);
    const spots = points.map(project);
    for (const item of inOrder(items(spots, project))) drawItem(item, radius);
    drawNames(spots, radius);
    drawTriad(height);
  }

  function radiusOf(height) {
    const growth = height / 2 / FIELD / camera.distance * take.typical / 480;
    return 4.5 * Math.min(Math.max(growth, 0.55), 1.6);
  }

  function items(spots, project) {
    const found = [];
    if (byId("skeleton").checked) {
      for (const [start, end, limb, isSpoke] of take.bones) {
        const [a, b] = [spots[start], spots[end]];
        const isLoose = take.isLoose(limb, frame);
        if (a && b) found.push({draw: drawBone, a, b, limb, isSpoke, isLoose, depth: (a.depth + b.depth) / 2});
      }
      for (let joint = 0; joint < nJoints; joint++)
        if (spots[joint]) found.push({draw: drawJoint, ...spots[joint], ...take.joints[joint], isOnTop: true});
    }
    if (byId("markers").checked) {
      for (let marker = 0; marker < nMarkers; marker++) {
        const spot = spots[nJoints + marker], state = take.stateOf(nJoints + marker, frame);
        if (spot) found.push({draw: drawMarker, ...spot, state, limb: take.limbOfMarker[marker]});
      }
      for (const spot of take.cloudAt(frame).map(project))
        if (spot) found.push({draw: drawMarker, ...spot, state: SEEN, limb: -1});
    }
    return found;
  }

  function inOrder(found) {  // from the farthest to the nearest; what is deeper fades
    const depths = found.map((item) => item.depth), nearest = Math.min(...depths);
    const span = Math.max(Math.max(...depths) - nearest, 0.4 * take.typical);
    for (const item of found) item.fog = Math.min(Math.round((FOGS - 1) * (item.depth - nearest) / span), FOGS - 1);
    const order = (item) => item.depth - (item.isOnTop ? 0.03 * take.typical : 0);  // joints before the ends of bones
    return found.sort((a, b) => order(b) - order(a));
  }

  function drawItem(item, radius) {
    item.draw(item, radius * Math.min(Math.max(camera.distance / item.depth, 0.7), 1.4));
  }

  function stroke(colour, width, dash = []) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.stroke();
  }

  function circle(x, y, radius) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
  }

  function drawBone({a, b, limb, isSpoke, isLoose, fog}, radius) {
    const width = radius * (isSpoke ? 0.4 : 0.95);
    pen.lineCap = "round";
    pen.beginPath();
    pen.moveTo(a.x, a.y);
    pen.lineTo(b.x, b.y);
    stroke(inks.named("raised"), width + 2);
    stroke(inks.limb(limb, isLoose ? FOGS - 1 : fog), width);
  }

  function drawJoint({x, y, open, doubtful, fog}, radius) {
    circle(x, y, radius);
    pen.fillStyle = inks.named("raised");
    pen.fill();
    pen.lineCap = "butt";
    const isWarm = open || doubtful;
    stroke(isWarm ? inks.named("warm") : inks.mixed("ink", fog), isWarm ? 2 : 1.4, open ? [2, 2] : []);
  }

  function drawMarker({x, y, state, limb, fog}, radius) {
    circle(x, y, state === FILLED ? 0.8 * radius : radius);
    if (state === FILLED) return stroke(inks.limb(limb, fog), 1.2);
    pen.fillStyle = inks.limb(limb, fog);
    pen.fill();
    stroke(inks.named("raised"), 0.8);
    if (state === DOUBTFUL) {
      circle(x, y, radius + 2.5);
      stroke(inks.named("warm"), 1.8);
    }
  }

  function drawFloor(project, points, radius) {
    const [low, high] = take.box;
    const cell = roundStep(Math.max(high[0] - low[0], high[2] - low[2], take.typical) / CELLS);
    const from = [0, 2].map((axis) => Math.floor(low[axis] / cell) - 1);
    const to = [0, 2].map((axis) => Math.ceil(high[axis] / cell) + 1);
    const line = (a, b) => {
      const [start, end] = [project(a), project(b)];
      if (start && end) { pen.moveTo(start.x, start.y); pen.lineTo(end.x, end.y); }
    };
    const corner = (x, z) => [x * cell, take.floor, z * cell];
    pen.beginPath();
    for (let x = from[0]; x <= to[0]; x++) for (let z = from[1]; z < to[1]; z++) line(corner(x, z), corner(x, z + 1));
    for (let z = from[1]; z <= to[1]; z++) for (let x = from[0]; x < to[0]; x++) line(corner(x, z), corner(x + 1, z));
    stroke(inks.named("rule"), 1);
    if (!byId("skeleton").checked) return;
    pen.beginPath();  // shadows straight below the bones show where these are in the room
    const below = (point) => point && [point[0], take.floor, point[2]];
    for (const [start, end] of take.bones)
      if (points[start] && points[end]) line(below(points[start]), below(points[end]));
    pen.lineCap = "round";
    stroke(inks.named("rule"), radius);
  }

  function roundStep(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return power * [1, 2, 5, 10].find((factor) => factor * power >= value);
  }

  function drawNames(spots, radius) {
    const shown = byId("markers").checked ? nMarkers : 0, taken = [];
    const found = [];
    for (let marker = 0; marker < shown; marker++) {
      const spot = spots[nJoints + marker];
      if (spot) found.push({...spot, text: take.names[marker], isNear: isNear(spot)});
    }
    found.sort((a, b) => b.isNear - a.isNear || a.depth - b.depth);
    const wanted = byId("names").checked ? found : found.filter((one) => one.isNear).slice(0, 1);
    pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    pen.textBaseline = "middle";
    for (const {x, y, text} of wanted) {
      const box = [x + radius + 3, y - 7, x + radius + 3 + pen.measureText(text).width, y + 7];
      const overlaps = (other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3];
      if (taken.some(overlaps)) continue;
      taken.push(box);
      pen.strokeStyle = inks.named("raised");
      pen.lineWidth = 3;
      pen.setLineDash([]);
      pen.strokeText(text, box[0], y);
      pen.fillStyle = inks.named("ink");
      pen.fillText(text, box[0], y);
    }
  }

  const isNear = ({x, y}) => pointer !== null && Math.hypot(x - pointer.x, y - pointer.y) < REACH;

  function drawTriad(height) {  // the world's axes
    const {right, up} = axesOfView(), x = 36, y = height - 36;
    pen.font = `11px ${getComputedStyle(document.body).fontFamily}`;
    pen.textBaseline = "middle";
    pen.textAlign = "center";
    pen.lineCap = "butt";
    take.axes.forEach((axis, index) => {
      const across = dot(axis, right), upward = dot(axis, up);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 20 * across, y - 20 * upward);
      stroke(inks.named("quiet"), 1.4);
      pen.fillStyle = inks.named("quiet");
      if (Math.hypot(across, upward) > 0.3) pen.fillText("XYZ"[index], x + 28 * across, y - 28 * upward);
    });
    pen.textAlign = "start";
  }

  // ---- Time.

  function show(wanted) {
    frame = Math.min(Math.max(Math.round(wanted), 0), nFrames - 1);
    slider.value = frame;
    const words = `${(frame / rate).toFixed(2)} s, frame ${frame * take.stride} of ${take.nAllFrames}`;
    readout.textContent = words;
    slider.setAttribute("aria-valuetext", words);
    ask();
  }

  function play(wanted) {
    if (nFrames < 2) return;
    if (wanted && frame === nFrames - 1) show(0);
    isPlaying = wanted;
    toggle.textContent = isPlaying ? "Pause" : "Play";
    clock = frame;
    let before = null;
    const step = (now) => {
      if (!isPlaying) return;
      if (before !== null) clock = (clock + (now - before) / 1000 * rate * Number(byId("speed").value)) % nFrames;
      before = now;
      if (Math.floor(clock) !== frame) show(Math.floor(clock));
      requestAnimationFrame(step);
    };
    if (isPlaying) requestAnimationFrame(step);
  }

  function scrub(wanted) {
    show(wanted);
    clock = frame;
  }

  // ---- Hands.

  function listen() {
    toggle.addEventListener("click", () => play(!isPlaying));
    slider.addEventListener("input", () => scrub(Number(slider.value)));
    slider.addEventListener("keydown", (event) => event.key === " " && onKey(event));
    byId("reset").addEventListener("click", reset);
    byId("follow").addEventListener("change", reset);
    for (const name of ["markers", "skeleton", "names"]) byId(name).addEventListener("change", ask);
    canvas.addEventListener("keydown", onKey);
    canvas.addEventListener("dblclick", reset);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", onWheel, {passive: false});
    listenToPointers();
    new ResizeObserver(ask).observe(canvas);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", chooseInks);
  }

  const KEYS = {
    " ": () => play(!isPlaying), ArrowLeft: () => turn(-20, 0), ArrowRight: () => turn(20, 0),
    ArrowUp: () => turn(0, -20), ArrowDown: () => turn(0, 20), "+": () => zoom(0.85), "-": () => zoom(1 / 0.85),
    ",": () => scrub(frame - 1), ".": () => scrub(frame + 1), Home: () => scrub(0), End: () => scrub(nFrames - 1),
    0: reset,
  };

  function onKey(event) {
    if (!(event.key in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    KEYS[event.key]();
  }

  function onWheel(event) {  // a page is scrolled over a view that nobody has clicked
    if (document.activeElement !== canvas && document.documentElement.scrollHeight > window.innerHeight) return;
    event.preventDefault();
    zoom(Math.exp(0.0012 * event.deltaY));
  }

  function listenToPointers() {  // one button or finger turns; shift, another button or two fingers move and zoom
    const held = new Map();
    const place = (event) => ({x: event.offsetX, y: event.offsetY});
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus();
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId), now = place(event);
      if (before) {
        const others = [...held].filter(([id]) => id !== event.pointerId).map(([, other]) => other);
        held.set(event.pointerId, now);
        const [across, down] = [now.x - before.x, now.y - before.y];
        if (others.length) {
          shift(across / 2, down / 2);
          zoom(distance(before, others[0]) / distance(now, others[0]));
        } else if (event.shiftKey || event.buttons !== 1) shift(across, down);
        else turn(across, down);
      }
      pointer = before ? null : now;
      ask();
    });
    for (const name of ["pointerup", "pointercancel"])
      canvas.addEventListener(name, (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => { pointer = null; ask(); });
  }

  const distance = (a, b) => Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1);

  // ---- Start.

  async function start() {
    try {
      await take.unpack();
    } catch (error) {
      readout.textContent = `This browser cannot unpack the take (${error.name}): open the page in a newer one.`;
      return;
    }
    const path = Math.hypot(...extent(take.middles));
    byId("follow").checked = path > take.typical;
    chooseInks();
    reset();
    listen();
    show(0);
    canvas.dataset.ready = "yes";
  }

  start();
})();
