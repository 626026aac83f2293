// A camera that turns about a point: drag to turn, two fingers or the right button to move, wheel or pinch to zoom.
class Orbit {
  constructor(camera, element, changed) {
    Object.assign(this, { camera, element, changed, fingers: new Map() });
    this.target = new THREE.Vector3();
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, event);
    });
    element.addEventListener("pointermove", (event) => this.drag(event));
    for (const end of ["pointerup", "pointercancel"])
      element.addEventListener(end, (event) => this.fingers.delete(event.pointerId));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * Math.max(-240, Math.min(240, event.deltaY))));
    }, { passive: false });
  }

  look(target, distance, azimuth, height) {
    Object.assign(this, { distance, azimuth, height });
    this.target.copy(target);
    this.nearest = distance / 12;
    this.farthest = distance * 6;
    this.place();
  }

  place() {
    const flat = Math.cos(this.height);
    this.camera.position.set(flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.height));
    this.camera.position.multiplyScalar(this.distance).add(this.target);
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
    this.changed();
  }

  drag(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const x = event.clientX - before.clientX, y = event.clientY - before.clientY;
    const span = this.span();
    this.fingers.set(event.pointerId, event);
    if (this.fingers.size === 1 && event.buttons !== 2 && !event.shiftKey) this.turn(x, y);
    else this.move(x / this.fingers.size, y / this.fingers.size);
    if (this.fingers.size === 2 && span > 0) this.zoom(span / this.span());
  }

  span() {
    const [a, b] = [...this.fingers.values()];
    return b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
  }

  turn(x, y) {
    this.azimuth -= 0.008 * x;
    this.height = Math.max(-1.5, Math.min(1.55, this.height + 0.006 * y));
    this.place();
  }

  move(x, y) {
    const step = 2 * this.distance * Math.tan(this.camera.fov * Math.PI / 360) / this.element.clientHeight;
    const { elements } = this.camera.matrixWorld;
    const right = new THREE.Vector3().fromArray(elements, 0), up = new THREE.Vector3().fromArray(elements, 4);
    this.target.addScaledVector(right, -x * step).addScaledVector(up, y * step);
    this.place();
  }

  zoom(factor) {
    if (!Number.isFinite(factor)) return;
    this.distance = Math.max(this.nearest, Math.min(this.farthest, this.distance * factor));
    this.place();
  }
}
