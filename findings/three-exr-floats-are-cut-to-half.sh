#!/usr/bin/env bash
# three.js 0.187.0 (npm), EXRLoader as it comes (type HalfFloatType), of a picture whose channels are FLOAT.
#
# Expected: each float becomes the nearest half float, as OpenEXR's own half, F16C and Math.f16round do: of many values
# what is too high and too low evens out, and none is off by more than 2^-11 of itself.
#
# Seen: the last 13 bits of the mantissa are cut off (DataUtils.toHalfFloat). No value comes out brighter, one is off by
# up to 2^-10 of itself, and of values spread evenly over their logarithm a picture loses 2^-11 / (2 ln 2), 0.035 % of
# its light. With setDataType(FloatType) they are what the file holds.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund --no-save --prefix "$folder" three@0.187.0 >/dev/null
cat >try.mjs <<'J'
import { DataTexture, DataUtils, FloatType, RGBAFormat } from 'three';
import { EXRExporter } from 'three/addons/exporters/EXRExporter.js';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
const [width, height] = [64, 64];
const values = Float32Array.from({ length: 4 * width * height }, (_, i) => 2 ** (((i * 0.6180339887) % 1) * 10 - 5));
const texture = new DataTexture(values, width, height, RGBAFormat, FloatType);
const bytes = await new EXRExporter().parse(texture, { type: FloatType });
const read = (type) => {
  const loader = new EXRLoader();
  if (type) loader.setDataType(type);
  return loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength)).data;
};
const whole = Float64Array.from(read(FloatType)).sort();
const halves = Float64Array.from(read(), DataUtils.fromHalfFloat).sort();
const off = Array.from(halves, (h, i) => h / whole[i] - 1);
const mean = off.reduce((a, b) => a + b) / off.length;
const same = Float64Array.from(values).sort().every((v, i) => v === whole[i]);
const [least, most] = [Math.min(...off), Math.max(...off)];
console.log('floats kept by FloatType:', same, '| halves off by', least, 'to', most, '| mean', mean);
const expected = -(2 ** -11) / (2 * Math.log(2));
console.log('mean of values that are cut off:', expected);
if (!same || most > 0 || least > -(2 ** -11) || Math.abs(mean / expected - 1) > 0.1)
  throw new Error('the behaviour has changed');
J
node try.mjs
echo "as described: three 0.187.0 cuts floats of an EXR off to halves"
