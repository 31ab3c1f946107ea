// One lightmap under any sky, in GLSL ES 3 (three.js, WebGL 2): the sum of pictures PREFIX.sky.K.exr (a DataArrayTexture
// of them, layer K), each by the sky's coefficient K (`lambent env SKY --order N --json`, or PREFIX.sky.json), is
// irradiance / pi: to be multiplied by the albedo and added as emission. Times pi it is what three.js calls irradiance.
precision highp sampler2DArray;
uniform sampler2DArray lambentSky;
uniform vec3 lambentSkyCoefficients[9];

vec3 lambentSkyLight(vec2 uv2) {
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 9; ++k) sum += lambentSkyCoefficients[k] * texture(lambentSky, vec3(uv2, float(k))).rgb;
  return max(sum, vec3(0.0));
}
