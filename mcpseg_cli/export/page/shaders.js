// What the graphics card runs: surfels, their shading by depth (eye-dome lighting), and thick lines.

const TABLE_WIDTH = 1024; // texels in a line of the table of objects
const HEIGHT_STEP = 0.002; // metres, and
const HEIGHT_LOW = -20; // metres: heights above the floor are kept as 16-bit steps from there

// how a pixel is marked, in the alpha of the picture; the background is 0
const MARKS = "const float PLAIN = 0.4, HOVERED = 0.7, PICKED = 1.0;";

const pointVertex = (ofMap) => `
precision highp float; precision highp int; precision highp usampler2D;
in vec4 position; // steps along x, y, z, and of the height above the floor
in vec4 normal; // and confidence
in vec4 paint; // a colour of the point's own
in uint label; // class << 24 | object
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float cut, radius, height;
uniform int mode; // 0 paint, 1 class, 2 object, 3 confidence
uniform bool isPicking;
uniform sampler2D classes, objects, ramp;
flat out vec3 colour;
flat out vec3 facing;
flat out vec4 id;
flat out float mark, middle, reach;
${MARKS}
${ofMap}
void main() {
  uint place = label & 0xffffffu;
  vec4 ofClass = texelFetch(classes, ivec2(label >> 24, 0), 0);
  vec4 ofObject = texelFetch(objects, ivec2(place & ${TABLE_WIDTH - 1}u, place / ${TABLE_WIDTH}u), 0);
  bool isShown = isSeen() && position.w <= cut && ofClass.a > 0.5 && ofObject.a > 0.1;
  gl_PointSize = 0.0;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (!isShown) return;

  // where, and how large
  vec4 view = modelViewMatrix * vec4(where(), 1.0);
  gl_Position = projectionMatrix * view;
  gl_PointSize = clamp(coarseness() * radius * projectionMatrix[1][1] * height / -view.z, 1.5, 96.0);
  middle = view.z;
  reach = gl_PointSize * -view.z / (projectionMatrix[1][1] * height);

  // towards the eye, lit from there and a little from above
  vec3 away = mat3(modelViewMatrix) * normal.xyz;
  vec3 eye = -normalize(view.xyz);
  facing = normalize(dot(away, eye) < 0.0 ? -away : away);
  float light = 0.80 + 0.17 * max(dot(facing, eye), 0.0) + 0.06 * abs(normal.z);

  vec3 own = mode == 0 ? paint.rgb : mode == 1 ? ofClass.rgb : mode == 2 ? ofObject.rgb
    : texelFetch(ramp, ivec2(int(round(255.0 * max(normal.w, 0.0))), 0), 0).rgb;
  mark = ofObject.a > 0.9 ? PICKED : ofObject.a > 0.6 ? HOVERED : PLAIN;
  float grey = dot(own, vec3(0.3, 0.59, 0.11));
  colour = light * (isPicking && mark < PICKED ? mix(own, vec3(0.75 * grey), 0.6) : own);
  uint number = firstNumber() + uint(gl_VertexID) + 1u;
  id = vec4(number & 255u, (number >> 8) & 255u, (number >> 16) & 255u, number >> 24) / 255.0;
}`;

// a map that is there as a whole, as it was after any scan
const WHOLE_VERTEX = pointVertex(`
in uint scan;
uniform vec3 low;
uniform float step;
uniform uint now;
bool isSeen() { return scan < now; }
vec3 where() { return low + step * position.xyz; }
float coarseness() { return 1.0; }
uint firstNumber() { return 0u; }`);

// a tile; `drawn` has for each tile that is drawn which of its eighths are, too, and where those are listed
const TILE_VERTEX = pointVertex(`
uniform vec3 low;
uniform float step, share, spacing;
uniform uint first;
uniform int tile;
uniform sampler2D drawn;
bool isSeen() { return true; }
vec3 where() { return low + step * position.xyz; }
uint firstNumber() { return first; }
int count(int bits) {
  bits -= (bits >> 1) & 0x55;
  bits = (bits & 0x33) + ((bits >> 2) & 0x33);
  return (bits + (bits >> 4)) & 0x0f;
}
// the spacing of what is drawn around the point, in voxels
float coarseness() {
  vec3 at = min(share * position.xyz, 0.99999);
  float found = spacing;
  for (int here = tile, k = 0; k < 21; k++) {
    ivec4 known = ivec4(round(255.0 * texelFetch(drawn, ivec2(here & ${TABLE_WIDTH - 1}, here / ${TABLE_WIDTH}), 0)));
    ivec3 upper = ivec3(2.0 * at);
    int eighth = upper.x | upper.y << 1 | upper.z << 2;
    if ((known.r >> eighth & 1) == 0) break;
    here = (known.g | known.b << 8 | known.a << 16) + count(known.r & ((1 << eighth) - 1));
    at = 2.0 * at - vec3(upper);
    found *= 0.5;
  }
  return found;
}`);

const POINT_FRAGMENT = `
precision highp float;
flat in vec3 colour;
flat in vec3 facing;
flat in vec4 id;
flat in float mark, middle, reach;
uniform mat4 projectionMatrix;
layout(location = 0) out vec4 picture;
layout(location = 1) out vec4 number;
void main() {
  // a disc that lies in the surface
  vec2 at = vec2(2.0, -2.0) * gl_PointCoord + vec2(-1.0, 1.0);
  float slope = -dot(facing.xy, at) / max(facing.z, 0.3);
  if (dot(at, at) + slope * slope > 1.0) discard;
  float z = middle + slope * reach;
  gl_FragDepth = 0.5 - 0.5 * (projectionMatrix[2][2] * z + projectionMatrix[3][2]) / z;
  picture = vec4(colour, mark);
  number = id;
}`;

const SCREEN_VERTEX = `
precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

const SCREEN_FRAGMENT = `
precision highp float; precision highp int; precision highp sampler2D;
uniform sampler2D picture, depth;
uniform float near, far, height;
uniform int reach, rim; // pixels to the neighbours looked at, for depth and for marks
uniform bool isMarking; // whether an object is picked or pointed at
out vec4 colour;
${MARKS}
const ivec2 WAYS[8] = ivec2[8](ivec2(1, 0), ivec2(0, 1), ivec2(-1, 0), ivec2(0, -1), ivec2(1, 1), ivec2(-1, 1), ivec2(-1, -1), ivec2(1, -1));
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(depth, 0) - 1;
  vec4 own = texelFetch(picture, here, 0);
  colour = vec4(mix(vec3(0.105, 0.125, 0.150), vec3(0.165, 0.192, 0.226), gl_FragCoord.y / height), 1.0);
  if (own.a > 0.0) {
    // darker, the farther neighbours lie in front (Boucheny 2009); 1 / distance is linear in the depth kept
    float a = 1.0 / near, b = (far - near) / (near * far);
    float mine = 1.0 / (a - b * texelFetch(depth, here, 0).r), behind = 0.0;
    for (int k = 0; k < 8; k++) {
      float other = texelFetch(depth, clamp(here + reach * WAYS[k], ivec2(0), last), 0).r;
      behind += clamp(mine * (a - b * other) - 1.0, 0.0, 0.04);
    }
    colour.rgb = own.rgb * max(exp2(-11.0 * behind), 0.2);
  }
  if (!isMarking) return;

  // what is picked has a white rim, what is pointed at a fainter one
  float most = own.a;
  for (int k = 0; k < 8; k++) most = max(most, texelFetch(picture, clamp(here + rim * WAYS[k], ivec2(0), last), 0).a);
  if (most > own.a + 0.1 && most > 0.6) colour.rgb = mix(colour.rgb, vec3(1.0), most > 0.9 ? 1.0 : 0.6);
}`;

const LINE_VERTEX = `
precision highp float;
in vec3 position, other; // this end of a stretch and the other one
in vec4 tint;
in float side;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform vec2 screen;
uniform float width; // pixels
out vec4 colour;
void main() {
  vec4 a = modelViewMatrix * vec4(position, 1.0), b = modelViewMatrix * vec4(other, 1.0);
  // an end behind the eye is drawn where the stretch comes into view
  float nearest = -0.05;
  if (a.z > nearest && b.z < nearest) a = mix(a, b, (a.z - nearest) / (a.z - b.z));
  else if (b.z > nearest && a.z < nearest) b = mix(b, a, (b.z - nearest) / (b.z - a.z));
  vec4 from = projectionMatrix * a, to = projectionMatrix * b;
  vec2 way = (to.xy / to.w - from.xy / from.w) * screen;
  way = length(way) > 1e-4 ? normalize(way) : vec2(1.0, 0.0);
  from.xy += side * width * vec2(-way.y, way.x) / screen * from.w;
  gl_Position = a.z > nearest ? vec4(2.0, 2.0, 2.0, 1.0) : from;
  colour = tint;
}`;

const LINE_FRAGMENT = `
precision highp float; precision highp sampler2D;
in vec4 colour;
uniform sampler2D depth;
uniform vec2 screen;
uniform float hidden; // opacity behind the map
out vec4 picture;
void main() {
  float there = texture(depth, gl_FragCoord.xy / screen).r;
  picture = vec4(colour.rgb, colour.a * (gl_FragCoord.z > there ? hidden : 1.0));
}`;
