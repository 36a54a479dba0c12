// The scene in 3D: surfaces, and the spheres of each side as one instanced mesh.

import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DynamicDrawUsage, Group,
  HemisphereLight, InstancedBufferAttribute, InstancedMesh, LineBasicMaterial, LineSegments, Mesh,
  MeshLambertMaterial, PCFShadowMap, PerspectiveCamera, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/orbit';

const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A sphere of two tones, so that rotation is seen.
function ball(segments) {
  const indexed = new SphereGeometry(1, 2 * segments, segments);
  const geometry = indexed.toNonIndexed();
  const place = geometry.getAttribute('position');
  const colours = new Float32Array(3 * place.count);
  for (let face = 0; face < place.count; face += 3) {
    const middle = [0, 1, 2].map((axis) => [0, 1, 2].reduce(
      (sum, corner) => sum + place.getComponent(face + corner, axis), 0));
    const tone = middle[0] * middle[1] * middle[2] > 0 ? 1 : 0.42;
    colours.fill(tone, 3 * face, 3 * face + 9);
  }
  geometry.setAttribute('color', new BufferAttribute(colours, 3));
  return geometry;
}

class Spheres {
  constructor(count, radii, geometry) {
    this.material = new MeshLambertMaterial({ vertexColors: true });
    this.mesh = new InstancedMesh(geometry, this.material, count);
    this.mesh.frustumCulled = false;
    this.mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    this.mesh.instanceColor = new InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.radii = radii;
  }

  place(positions, quaternions) {
    const matrix = this.mesh.instanceMatrix.array;
    for (let sphere = 0, at = 0; sphere < this.radii.length; sphere += 1, at += 16) {
      const r = this.radii[sphere];
      const [x, y, z, w] = quaternions.subarray(4 * sphere, 4 * sphere + 4);
      matrix[at] = r * (1 - 2 * (y * y + z * z));
      matrix[at + 1] = 2 * r * (x * y + z * w);
      matrix[at + 2] = 2 * r * (x * z - y * w);
      matrix[at + 4] = 2 * r * (x * y - z * w);
      matrix[at + 5] = r * (1 - 2 * (x * x + z * z));
      matrix[at + 6] = 2 * r * (y * z + x * w);
      matrix[at + 8] = 2 * r * (x * z + y * w);
      matrix[at + 9] = 2 * r * (y * z - x * w);
      matrix[at + 10] = r * (1 - 2 * (x * x + y * y));
      for (let axis = 0; axis < 3; axis += 1) matrix[at + 12 + axis] = positions[3 * sphere + axis];
      matrix[at + 15] = 1;
    }
    this.mesh.instanceMatrix.needsUpdate = true;
  }

  paint(colours) {
    this.mesh.instanceColor.array.set(colours);
    this.mesh.instanceColor.needsUpdate = true;
  }

  ghost(is) {
    this.material.transparent = is;
    this.material.opacity = is ? 0.38 : 1;
    this.material.depthWrite = !is;
    this.mesh.castShadow = !is;
    this.mesh.receiveShadow = !is;
    this.material.needsUpdate = true;
  }
}

// Lines on a rectangle, a round number of metres apart.
function gridLines(corners) {
  const [a, b, , d] = corners.map((corner) => new Vector3(...corner));
  const sides = [b.clone().sub(a), d.clone().sub(a)];
  const longest = Math.max(sides[0].length(), sides[1].length());
  const decade = 10 ** Math.floor(Math.log10(longest / 8));
  const step = decade * [1, 2, 5, 10].find((factor) => longest / (factor * decade) <= 16);
  const points = [];
  sides.forEach((side, index) => {
    const across = sides[1 - index];
    for (let at = 0; at <= side.length() + 1e-9 * longest; at += step) {
      const from = a.clone().addScaledVector(side, at / side.length());
      points.push(from, from.clone().add(across));
    }
  });
  return new BufferGeometry().setFromPoints(points);
}

export class Stage {
  constructor(container, payload) {
    this.container = container;
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    container.prepend(this.renderer.domElement);

    this.scene = new Scene();
    this.scene.background = new Color();
    this.up = new Vector3(...payload.up);
    const [low, high] = payload.focus;
    this.corners = [0, 1, 2, 3, 4, 5, 6, 7].map((which) => new Vector3(
      ...[0, 1, 2].map((axis) => (which & (1 << axis) ? high : low)[axis])));
    this.centre = this.corners[0].clone().add(this.corners[7]).multiplyScalar(0.5);
    this.size = 0.5 * this.corners[0].distanceTo(this.corners[7]);
    this.#light(payload);
    this.#surfaces(payload.quads);
    const segments = payload.count <= 400 ? 12 : 6;
    const geometry = ball(segments);
    this.sides = payload.sides.map(() => new Spheres(payload.count, payload.radii, geometry));
    for (const side of this.sides) this.scene.add(side.mesh);

    this.camera = new PerspectiveCamera(38, 1, this.size * 0.005, this.size * 60);
    this.camera.up.copy(this.up);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener('change', () => { this.stale = true; });
    this.controls.addEventListener('start', () => { this.moved = true; });
    this.show('overlay');
    this.theme();
    new ResizeObserver(() => { this.stale = true; }).observe(container);
  }

  #light(payload) {
    this.scene.add(new AmbientLight(0xffffff, 0.55));
    const sky = new HemisphereLight(0xffffff, 0x8090a0, 1.1);
    sky.position.copy(this.up);
    this.scene.add(sky);
    const sun = new DirectionalLight(0xffffff, 2.0);
    const aside = new Vector3(0.35, -0.5, 0).addScaledVector(this.up, 1).normalize();
    const [low, high] = payload.extent.map((corner) => new Vector3(...corner));
    const reach = 1.5 * this.size;  // a shadow that falls here comes along the light, from however far
    const far = 1.1 * high.distanceTo(low) + reach;
    sun.position.copy(this.centre).addScaledVector(aside, far);
    sun.target.position.copy(this.centre);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    Object.assign(sun.shadow.camera, {
      left: -reach, right: reach, top: reach, bottom: -reach, near: 0, far: 2 * far,
    });
    sun.shadow.normalBias = reach / 1024;
    this.scene.add(sun, sun.target);
  }

  #surfaces(quads) {
    // seen from the front only: walls do not hide what they hold
    this.endless = new MeshLambertMaterial();
    this.slab = new MeshLambertMaterial();
    this.line = new LineBasicMaterial({ transparent: true, opacity: 0.75 });
    for (const { corners, endless } of quads) {
      const geometry = new BufferGeometry();
      const order = [0, 1, 2, 0, 2, 3].flatMap((corner) => corners[corner]);
      geometry.setAttribute('position', new BufferAttribute(new Float32Array(order), 3));
      geometry.computeVertexNormals();
      const mesh = new Mesh(geometry, endless ? this.endless : this.slab);
      mesh.receiveShadow = true;
      const group = new Group();
      group.add(mesh, new LineSegments(gridLines(corners), this.line));
      this.scene.add(group);
      const normal = new Vector3().fromBufferAttribute(geometry.getAttribute('normal'), 0);
      // lines of a wall vanish with it when it is seen from behind
      mesh.onBeforeRender = (renderer, scene, camera) => {
        const towards = camera.position.clone().sub(new Vector3(...corners[0]));
        group.children[1].visible = towards.dot(normal) > 0;
      };
    }
  }

  // The corners of what most spheres are in just within a pane.
  #frame(aspect) {
    const outwards = new Vector3(0.62, -1, 0).normalize().addScaledVector(this.up, 0.5).normalize();
    const right = this.up.clone().cross(outwards).normalize();
    const top = outwards.clone().cross(right);
    const slope = 0.86 * Math.tan((0.5 * this.camera.fov * Math.PI) / 180);
    const distance = Math.max(...this.corners.map((corner) => {
      const local = corner.clone().sub(this.centre);
      const reach = Math.max(Math.abs(local.dot(right)) / aspect, Math.abs(local.dot(top)));
      return reach / slope + local.dot(outwards);
    }));
    this.camera.position.copy(this.centre).addScaledVector(outwards, distance);
    this.controls.target.copy(this.centre);
    this.controls.update();
  }

  // `overlay`, `beside`, or the number of the one side to show.
  show(view) {
    this.view = view;
    this.framed = this.moved;  // a view that somebody chose stays
    this.sides.forEach((side, index) => side.ghost(view === 'overlay' && index === 1));
    this.stale = true;
  }

  theme() {
    this.scene.background.set(themed('sky'));
    this.endless.color.set(themed('floor'));
    this.slab.color.set(themed('slab'));
    this.line.color.set(themed('grid'));
    this.stale = true;
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.container;
    const { renderer, camera } = this;
    if (renderer.domElement.width !== Math.floor(width * renderer.getPixelRatio())
        || renderer.domElement.height !== Math.floor(height * renderer.getPixelRatio())) {
      renderer.setSize(width, height);
    }
    const beside = this.view === 'beside';
    const panes = beside ? [[1], [0]] : [this.view === 'overlay' ? [0, 1] : [Number(this.view)]];
    const pane = Math.floor(width / panes.length);
    camera.aspect = pane / height;
    if (!this.framed) this.#frame(camera.aspect);
    this.framed = true;
    camera.updateProjectionMatrix();
    renderer.setScissorTest(beside);
    panes.forEach((shown, place) => {
      renderer.setViewport(place * pane, 0, pane, height);
      renderer.setScissor(place * pane, 0, pane, height);
      this.sides.forEach((side, index) => { side.mesh.visible = shown.includes(index); });
      renderer.render(this.scene, camera);
    });
    this.stale = false;
  }
}
