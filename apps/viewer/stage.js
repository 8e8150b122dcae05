// The scene in 3D: what is drawn, from where, and at which time of which motion.
import {
  AnimationMixer, Box3, Color, DirectionalLight, EdgesGeometry, HemisphereLight, LineBasicMaterial, LineSegments,
  LoopOnce, PCFShadowMap, PerspectiveCamera, Scene, Sphere, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';

const FIELD_OF_VIEW = 32;     // degrees, vertical
const EDGE_ANGLE = 25;        // degrees between faces; from there on their edge is drawn
const POINT_SIZE = 2;         // CSS pixels
const MARGIN = 1.05;          // of the distance from which all is just in view
const LEAST_POLAR = 0.02;     // radians from the vertical: straight down has no up

/** Radians; exact near 0 as well, where the arc cosine of single-precision numbers is not. */
function angleBetween(a, b) {
  const { x, y, z, w } = a.clone().conjugate().multiply(b);
  return 2 * Math.atan2(Math.hypot(x, y, z), Math.abs(w));
}

/** The glTF binary `bytes` on the canvas; null if the browser has no WebGL. Throws if the bytes are no glTF. */
export async function openStage(canvas, bytes) {
  // The buffer is kept so that the picture can be printed.
  const context = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: true });
  if (!context) return null;
  return new Stage(canvas, context, await new GLTFLoader().parseAsync(bytes.buffer, ''));
}

class Stage {
  constructor(canvas, context, gltf) {
    this.canvas = canvas;
    this.scene = new Scene();
    this.scene.background = new Color(0xeef1f4);
    this.scene.add(gltf.scene);
    gltf.scene.updateMatrixWorld(true);
    this.depthCamera = gltf.cameras[0];
    this.motions = gltf.animations;
    this.mixer = new AnimationMixer(gltf.scene);
    this.bodies = [];  // what moves; the query last
    for (const node of gltf.scene.children[0].children) this.prepare(node);
    this.measure();

    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;  // turning the view moves no shadow
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 50);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI / 2;
    this.controls.maxDistance = 20 * this.ball.radius;
    this.controls.listenToKeyEvents(canvas);
    // A page that scrolls under the mouse must not zoom instead.
    this.controls.enableZoom = false;
    canvas.addEventListener('focus', () => { this.controls.enableZoom = true; });
    canvas.addEventListener('blur', () => { this.controls.enableZoom = false; });
    this.controls.addEventListener('change', () => this.draw());
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.lookFrom('camera');
    this.light();
    if (this.motions.length > 0) this.choose(0);
    this.draw();
  }

  prepare(node) {
    const name = node.userData.name ?? '';
    if (name === 'observed') {
      this.points = node;
      node.visible = false;
    } else if (name !== 'table' && !node.isCamera) {
      this.bodies.push(node);
    }
    const meshes = [];
    node.traverse((part) => { if (part.isMesh) meshes.push(part); });
    for (const mesh of meshes) {
      mesh.castShadow = name !== 'table';
      mesh.receiveShadow = true;
      if (name === 'table') continue;
      const edges = new LineSegments(new EdgesGeometry(mesh.geometry, EDGE_ANGLE),
                                     new LineBasicMaterial({ color: 0x101418, transparent: true, opacity: 0.55 }));
      mesh.add(edges);
      // Faces a hair behind their edges.
      Object.assign(mesh.material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    }
  }

  /** What must be in view: the corners of all bodies' boxes at the start of every motion. */
  measure() {
    this.corners = [];
    const all = new Box3(), box = new Box3();
    for (let motion = 0; motion < Math.max(this.motions.length, 1); ++motion) {
      if (this.motions.length > 0) this.choose(motion);
      for (const body of this.bodies) {
        body.updateMatrixWorld(true);
        all.union(box.setFromObject(body));
        for (const x of [box.min.x, box.max.x]) {
          for (const y of [box.min.y, box.max.y]) {
            for (const z of [box.min.z, box.max.z]) this.corners.push(new Vector3(x, y, z));
          }
        }
      }
    }
    this.ball = all.isEmpty() ? new Sphere(new Vector3(), 0.2) : all.getBoundingSphere(new Sphere());
  }

  /** A lamp beside where the picture was taken from, with shadows, a weak one opposite, and light from the sky. */
  light() {
    this.scene.add(new HemisphereLight(0xffffff, 0xc8c4bc, 1.5));
    const lamp = new DirectionalLight(0xffffff, 2.0), opposite = new DirectionalLight(0xffffff, 0.7);
    const aside = this.camera.position.clone().sub(this.controls.target).setY(0).normalize()
      .applyAxisAngle(new Vector3(0, 1, 0), -0.9);
    lamp.position.copy(this.ball.center).addScaledVector(aside, 3 * this.ball.radius);
    lamp.position.y += 5 * this.ball.radius;
    lamp.target.position.copy(this.ball.center);
    lamp.castShadow = true;
    const reach = 2.5 * this.ball.radius;
    Object.assign(lamp.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.01, far: 12 * reach });
    lamp.shadow.mapSize.set(2048, 2048);
    lamp.shadow.radius = 3;
    lamp.shadow.normalBias = 0.01 * this.ball.radius;
    opposite.position.copy(this.ball.center).addScaledVector(aside, -3 * this.ball.radius);
    opposite.position.y += this.ball.radius;
    opposite.target = lamp.target;
    this.scene.add(lamp, opposite, lamp.target);
    this.renderer.shadowMap.needsUpdate = true;
  }

  resize() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.points) Object.assign(this.points.material, { size: POINT_SIZE * this.renderer.getPixelRatio(), sizeAttenuation: false });
    this.draw();
  }

  /** All of the objects in view: as the depth camera saw them ('camera'), from 'above' or from the 'side'. */
  lookFrom(where) {
    const away = this.depthCamera.getWorldPosition(new Vector3()).sub(this.ball.center);
    if (where === 'above') away.setLength(1).setY(0).normalize().multiplyScalar(LEAST_POLAR).setY(1);
    if (where === 'side') away.setY(0.12 * Math.hypot(away.x, away.z));
    away.normalize();
    this.controls.target.copy(this.ball.center);
    this.camera.position.copy(this.ball.center).addScaledVector(away, MARGIN * this.distanceThatShowsAll(away));
    this.controls.update();
    this.draw();
  }

  /** From the ball's centre towards `away`, a unit vector, in metres. */
  distanceThatShowsAll(away) {
    const right = new Vector3(0, 1, 0).cross(away).normalize(), up = away.clone().cross(right);
    const tall = Math.tan(0.5 * FIELD_OF_VIEW * Math.PI / 180), wide = tall * this.camera.aspect;
    return this.corners.reduce((distance, corner) => {
      const p = corner.clone().sub(this.ball.center);
      return Math.max(distance, p.dot(away) + Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(up)) / tall));
    }, this.ball.radius);
  }

  showPoints(visible) {
    this.points.visible = visible;
    this.draw();
  }

  /** The motion of a candidate, at its start. */
  choose(index) {
    this.mixer.stopAllAction();
    this.action = this.mixer.clipAction(this.motions[index]).setLoop(LoopOnce);
    this.action.play().paused = true;  // it is moved by setTime alone
    this.setTime(0);
    this.start = this.bodies.map((body) => ({ position: body.position.clone(), turn: body.quaternion.clone() }));
  }

  get duration() { return this.action.getClip().duration; }

  setTime(seconds) {
    this.action.time = seconds;
    this.mixer.update(0);
    if (this.renderer) this.renderer.shadowMap.needsUpdate = true;
    this.draw();
  }

  /** How far what has moved most has moved since the start, in metres and radians. */
  moved() {
    let shift = 0, turn = 0;
    this.bodies.forEach((body, i) => {
      shift = Math.max(shift, body.position.distanceTo(this.start[i].position));
      turn = Math.max(turn, angleBetween(body.quaternion, this.start[i].turn));
    });
    return { shift, turn };
  }

  /** Names and colours of what is there: [{name, colour}]. */
  materials() {
    const found = new Map();
    for (const body of this.bodies) {
      body.traverse((part) => { if (part.isMesh) found.set(part.material.name, `#${part.material.color.getHexString()}`); });
    }
    return [...found].map(([name, colour]) => ({ name, colour }));
  }

  draw() {
    if (this.renderer) this.renderer.render(this.scene, this.camera);
  }
}
