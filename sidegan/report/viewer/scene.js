// The arm in space with what it must not touch.
const SHAPE = "#4d8bc9", OBSTACLE = "#c77d0a", PATH = "#b2182b";
const LINKS = ["#8e99a3", "#d9dee3"]; // of links, alternating
const CREASE = Math.cos(0.6); // of the largest angle between faces across which shading is smooth

class Space {
  constructor(data, canvas) {
    Object.assign(this, { data, canvas, due: true });
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.outputEncoding = THREE.sRGBEncoding;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.joints = data.joints.map(() => new THREE.Group());
    this.base = new THREE.Group();
    this.scene.add(this.base, ...this.joints);
    for (const joint of this.joints) joint.matrixAutoUpdate = false;
    this.solid = this.surfaces("arm", paint);
    this.shapes = this.surfaces("shapes", () => clear(SHAPE, 0.35));
    this.surfaces("obstacles", () => clear(OBSTACLE, 0.45)).forEach((mesh) => mesh.add(edges(mesh.geometry, OBSTACLE)));
    this.measure();
    this.light();
    this.ground();
    this.orbit = new Orbit(this.camera, canvas, () => { this.due = true; });
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
    this.reset();
  }

  surfaces(kind, material) {
    return this.data[kind].map((link, k) => {
      const mesh = new THREE.Mesh(geometry(this.data.arrays, `${kind}${k}`), material(link));
      mesh.castShadow = kind === "arm";
      mesh.receiveShadow = kind === "arm";
      (link < 0 ? this.base : this.joints[link]).add(mesh);
      return mesh;
    });
  }

  // Frames of the joints at their positions.
  pose(positions) {
    const { rotation, translation, axis } = this.data.chain, world = new THREE.Matrix4();
    positions.forEach((q, i) => {
      const r = rotation[i], t = translation[i], direction = new THREE.Vector3(...axis[i]);
      const local = new THREE.Matrix4().set(
        r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0, 0, 0, 1);
      const move = this.data.prismatic[i]
        ? new THREE.Matrix4().makeTranslation(...direction.multiplyScalar(q).toArray())
        : new THREE.Matrix4().makeRotationAxis(direction, q);
      world.multiply(local).multiply(move);
      this.joints[i].matrix.copy(world);
      this.joints[i].matrixWorldNeedsUpdate = true;
    });
    this.due = true;
    return new THREE.Vector3(...this.data.chain.tip).applyMatrix4(world);
  }

  // What lies within the picture: the paths of the end effector, and the arm as it stands.
  measure() {
    this.box = new THREE.Box3().setFromPoints([new THREE.Vector3()]);
    for (let k = 0; k < this.data.titles.length; k++)
      for (let sample = 0; sample <= this.data.samples; sample += 10)
        this.box.expandByPoint(this.pose(positions(this.data, k, sample)));
    this.pose(positions(this.data, 0, 0));
    this.scene.updateMatrixWorld(true);
    for (const mesh of this.solid) this.box.expandByObject(mesh);
    this.ball = this.box.getBoundingSphere(new THREE.Sphere());
  }

  light() {
    const { center, radius } = this.ball, sun = new THREE.DirectionalLight("#fff7ea", 0.85);
    sun.position.copy(center).add(new THREE.Vector3(1.1, -1.4, 2.6).multiplyScalar(radius));
    sun.target.position.copy(center);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    sun.shadow.radius = 5;
    sun.shadow.bias = -0.0004;
    sun.shadow.normalBias = 0.004 * radius;
    const view = sun.shadow.camera, reach = 1.7 * radius;
    Object.assign(view, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * radius, far: 8 * radius });
    const rim = new THREE.DirectionalLight("#cfe4ff", 0.35);
    rim.position.copy(center).add(new THREE.Vector3(-1.5, 1.2, 0.8).multiplyScalar(radius));
    this.scene.add(sun, sun.target, rim, new THREE.HemisphereLight("#ffffff", "#9fb0c0", 0.62));
  }

  // A grid on the ground, and the planes that the arm must not cross.
  ground() {
    const { radius, center } = this.ball, size = 2 * Math.ceil(2.2 * radius); // [m]
    this.grid = new THREE.GridHelper(size, Math.min(5 * size, 60), "#7f8c99", "#7f8c99");
    this.grid.rotation.x = Math.PI / 2;
    const night = matchMedia("(prefers-color-scheme: dark)");
    const fade = () => { this.grid.material.opacity = night.matches ? 0.1 : 0.22; this.due = true; };
    Object.assign(this.grid.material, { transparent: true, depthWrite: false });
    night.addEventListener("change", fade);
    fade();
    const shade = new THREE.Mesh(new THREE.PlaneGeometry(size, size), new THREE.ShadowMaterial({ opacity: 0.2 }));
    shade.receiveShadow = true;
    shade.position.z = this.grid.position.z = Math.min(0, this.box.min.z) - 0.001 * radius;
    this.scene.add(this.grid, shade);
    for (const { normal, offset } of this.data.planes) {
      const up = new THREE.Vector3(...normal), material = clear(OBSTACLE, 0.13);
      material.side = THREE.DoubleSide;
      const plane = new THREE.Mesh(new THREE.CircleGeometry(1.2 * radius, 96), material);
      plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
      plane.position.copy(center).addScaledVector(up, offset - up.dot(center));
      this.scene.add(plane);
    }
  }

  // The path of the end effector along one trajectory.
  trace(trajectory) {
    if (this.path) { this.scene.remove(this.path); this.path.geometry.dispose(); }
    const points = [], apart = 0.002 * this.ball.radius; // a tube has no direction where the arm rests
    for (let sample = 0; sample < this.data.samples; sample++) {
      const tip = this.pose(positions(this.data, trajectory, sample));
      if (!points.length || tip.distanceTo(points[points.length - 1]) > apart) points.push(tip);
    }
    if (points.length > 1 && points[0].distanceTo(points[points.length - 1]) < apart) points.pop();
    while (points.length < 3) points.push(points[0].clone().addScalar(apart * points.length));
    const curve = new THREE.CatmullRomCurve3(points, true);
    const tube = new THREE.TubeGeometry(curve, 2 * points.length, 0.0025 * this.ball.radius, 6, true);
    const shown = this.path ? this.path.visible : true;
    this.path = new THREE.Mesh(tube, new THREE.MeshBasicMaterial({ color: linear(PATH), transparent: true, opacity: 0.75 }));
    this.path.visible = shown;
    this.scene.add(this.path);
  }

  show(what, visible) {
    if (what === "path") this.path.visible = visible;
    else {
      for (const mesh of this.shapes) mesh.visible = visible;
      for (const mesh of this.solid) {
        mesh.material.transparent = visible;
        mesh.material.opacity = visible ? 0.45 : 1;
        mesh.material.needsUpdate = true;
      }
    }
    this.due = true;
  }

  reset() {
    const { center, radius } = this.ball, narrow = Math.min(1, this.camera.aspect);
    const distance = radius / Math.sin(this.camera.fov * Math.PI / 360) / narrow * 0.72;
    this.camera.near = distance / 200;
    this.camera.far = distance * 12;
    this.camera.updateProjectionMatrix();
    this.orbit.look(center, distance, -0.9, 0.36);
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / Math.max(clientHeight, 1);
    this.camera.updateProjectionMatrix();
    this.due = true;
  }

  draw() {
    if (this.due) this.renderer.render(this.scene, this.camera);
    this.due = false;
  }
}

function linear(colour) {
  return new THREE.Color(colour).convertSRGBToLinear();
}

function paint(link) {
  return new THREE.MeshStandardMaterial({ color: linear(LINKS[(link + 2) % 2]), roughness: 0.55, metalness: 0.08, side: THREE.DoubleSide });
}

function clear(colour, opacity) {
  return new THREE.MeshStandardMaterial({ color: linear(colour), transparent: true, opacity, roughness: 0.9, depthWrite: false });
}

function edges(shape, colour) {
  return new THREE.LineSegments(new THREE.EdgesGeometry(shape, 25), new THREE.LineBasicMaterial({ color: linear(colour) }));
}

// Triangles of a surface, with normals that shade smoothly except across creases.
function geometry(arrays, name) {
  const vertices = arrays[`${name}v`], faces = arrays[`${name}f`], count = faces.length;
  const corners = new Float32Array(3 * count), flat = new Float32Array(count), around = new Map();
  const a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
  for (let i = 0; i < count; i++)
    for (let k = 0; k < 3; k++) corners[3 * i + k] = vertices[3 * faces[i] + k];
  for (let f = 0; f < count; f += 3) {
    [a, b, c].forEach((point, k) => point.fromArray(corners, 3 * (f + k)));
    b.sub(a).cross(c.sub(a)).toArray(flat, f); // as long as twice the area
    for (let k = 0; k < 3; k++) {
      const list = around.get(faces[f + k]);
      if (list) list.push(f);
      else around.set(faces[f + k], [f]);
    }
  }
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const own = i - i % 3, [x, y, z] = [flat[own], flat[own + 1], flat[own + 2]], length = Math.hypot(x, y, z);
    let nx = 0, ny = 0, nz = 0;
    for (const f of around.get(faces[i])) {
      const [u, v, w] = [flat[f], flat[f + 1], flat[f + 2]];
      if (x * u + y * v + z * w >= CREASE * length * Math.hypot(u, v, w)) { nx += u; ny += v; nz += w; }
    }
    const size = Math.hypot(nx, ny, nz) || 1;
    normals.set([nx / size, ny / size, nz / size], 3 * i);
  }
  const made = new THREE.BufferGeometry();
  made.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  made.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  return made;
}
