// What of three.js the page takes. three.min.js is made of this file and of three 0.187 (MIT, three.LICENSE):
//   npm install three@0.187 esbuild
//   npx esbuild three.entry.js --bundle --minify --format=iife --global-name=THREE --outfile=three.min.js
export {
  BufferAttribute, BufferGeometry, DataTexture, DepthTexture, DoubleSide, GLSL3, Mesh, NearestFilter, NoBlending,
  PerspectiveCamera, PlaneGeometry, Points, RawShaderMaterial, RGBAFormat, Scene, Sphere, TOUCH, UnsignedByteType,
  UnsignedIntType, Vector2, Vector3, WebGLRenderer, WebGLRenderTarget,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
