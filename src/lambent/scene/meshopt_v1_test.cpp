// Version 1 of the attribute codec against an encoder of a few lines; the colour filter against its closed form.
#include <lambent/core/random.h>
#include <lambent/scene/gltf_packed_test-inl.h>
#include <lambent/scene/meshopt_v1.h>

#include <gtest/gtest.h>

#include <bit>

namespace lambent {
namespace {

using namespace test;

uint8_t zigzag8(uint8_t v) { return uint8_t(v & 0x80 ? ~(v << 1) : v << 1); }
uint16_t zigzag16(uint16_t v) { return uint16_t(v & 0x8000 ? ~(v << 1) : v << 1); }

// Sixteen deltas at so many bits.
Bytes packed_group(const uint8_t* d, int bits) {
  Bytes out(size_t(2 * bits)), whole;
  const unsigned sentinel = (1u << bits) - 1;
  for (size_t i = 0; i < 16; ++i) {
    const unsigned v = bits < 8 && d[i] >= sentinel ? sentinel : d[i];
    const size_t bit = i * size_t(bits), shift = bits == 1 ? bit % 8 : 8 - size_t(bits) - bit % 8;
    out[bit / 8] = uint8_t(out[bit / 8] | v << shift);
    if (bits < 8 && v == sentinel) whole.push_back(d[i]);
  }
  out.insert(out.end(), whole.begin(), whole.end());
  return out;
}

// `control(lane)` chooses how a lane is stored, of those that can; headers come round in turn.
Bytes encode_v1(const Bytes& data, size_t stride, const Bytes& modes, const std::function<unsigned(size_t)>& control) {
  const size_t count = data.size() / stride, block = std::min<size_t>(8192 / stride / 16 * 16, 256);
  Bytes out = {0xa1}, last(data.begin(), data.begin() + ptrdiff_t(stride));
  const Bytes baseline = last;
  unsigned turn = 0;
  for (size_t first = 0; first < count; first += block) {
    const size_t n = std::min(block, count - first), groups = (n + 15) / 16;
    std::vector<Bytes> lanes(stride, Bytes(groups * 16, 0));
    for (size_t i = 0; i < n; ++i) {
      const uint8_t* e = data.data() + (first + i) * stride;
      for (size_t c = 0; c < stride; c += 4) {
        uint32_t now, before;
        std::memcpy(&now, e + c, 4), std::memcpy(&before, last.data() + c, 4);
        uint32_t d = 0;
        const uint8_t mode = modes[c / 4];
        if (mode == 0)
          for (int k = 0; k < 4; ++k) d |= uint32_t(zigzag8(uint8_t(e[c + size_t(k)] - last[c + size_t(k)]))) << 8 * k;
        else if (mode == 1)
          for (int k = 0; k < 32; k += 16)
            d |= uint32_t(zigzag16(uint16_t((now >> k & 0xffff) - (before >> k & 0xffff)))) << k;
        else d = std::rotl(now ^ before, mode >> 4);
        for (size_t k = 0; k < 4; ++k) lanes[c + k][i] = uint8_t(d >> 8 * k);
      }
      last.assign(e, e + stride);
    }
    Bytes controls(stride / 4, 0), body;
    for (size_t lane = 0; lane < stride; ++lane) {
      const Bytes& l = lanes[lane];
      const bool zero = std::all_of(l.begin(), l.end(), [](uint8_t v) { return v == 0; });
      unsigned mode = control(lane);
      if (mode == 2 && !zero) mode = 1;
      controls[lane / 4] = uint8_t(controls[lane / 4] | mode << 2 * (lane % 4));
      if (mode == 2) continue;
      if (mode == 3) {
        body.insert(body.end(), l.begin(), l.begin() + ptrdiff_t(n));
        continue;
      }
      Bytes headers((groups + 3) / 4, 0), stored;
      for (size_t g = 0; g < groups; ++g) {
        const uint8_t* d = l.data() + 16 * g;
        unsigned header = turn++ % 4;
        if (mode == 0 && header == 0 && std::any_of(d, d + 16, [](uint8_t v) { return v != 0; })) header = 1;
        headers[g / 4] = uint8_t(headers[g / 4] | header << 2 * (g % 4));
        const int bits = mode == 0 ? (header == 0 ? 0 : 1 << (header - 1)) : 1 << header;
        const Bytes group = bits ? packed_group(d, bits) : Bytes();
        stored.insert(stored.end(), group.begin(), group.end());
      }
      body.insert(body.end(), headers.begin(), headers.end());
      body.insert(body.end(), stored.begin(), stored.end());
    }
    out.insert(out.end(), controls.begin(), controls.end()), out.insert(out.end(), body.begin(), body.end());
  }
  const size_t tail = stride + stride / 4;
  out.resize(out.size() + (tail < 24 ? 24 - tail : 0), 0);
  out.insert(out.end(), baseline.begin(), baseline.end()), out.insert(out.end(), modes.begin(), modes.end());
  return out;
}

Bytes smooth_bytes(size_t size, uint64_t seed) {
  Random random(seed);
  Bytes data(size);
  for (size_t i = 0; i < size; ++i)
    data[i] = uint8_t(i / 40 + (random.next64() % 8 ? random.next64() % 3 : random.next64()));
  return data;
}

TEST(MeshoptV1, DecodesWhatWasEncoded) {
  for (size_t stride : {4, 8, 12, 20, 64, 256})
    for (size_t count : {1, 15, 16, 17, 256, 257, 700})
      for (uint8_t mode : {0x00, 0x01, 0x02, 0x72, 0xf2}) {
        const Bytes data = smooth_bytes(stride * count, stride + count);
        Bytes modes(stride / 4, mode);
        modes[0] = 1;
        const Bytes stream = encode_v1(data, stride, modes, [](size_t lane) { return unsigned(lane % 4); });
        Bytes out;
        ASSERT_TRUE(decode_attributes_v1(stream, count, stride, out)) << stride << " " << count << " " << int(mode);
        ASSERT_EQ(out, data) << stride << " " << count << " " << int(mode);
      }
}

// The example of the extension's text: sixteen deltas at four bits.
TEST(MeshoptV1, ExampleOfTheSpecification) {
  Bytes stream = {0xa1, 0xa8, 0x03, 0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5};
  stream.resize(stream.size() + 24, 0);  // a baseline of zeros, byte deltas
  Bytes out;
  ASSERT_TRUE(decode_attributes_v1(stream, 16, 4, out));
  uint8_t value = 0;
  const int deltas[16] = {-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0};
  for (size_t i = 0; i < 16; ++i) {
    value = uint8_t(value + deltas[i]);
    EXPECT_EQ(out[4 * i], value) << i;
    EXPECT_EQ(out[4 * i + 1], 0);
  }
}

TEST(MeshoptV1, BrokenStreamsAreRefused) {
  const size_t stride = 12, count = 40;
  const Bytes stream =
      encode_v1(smooth_bytes(stride * count, 1), stride, {0, 1, 2}, [](size_t lane) { return unsigned(lane % 4); });
  Bytes out;
  ASSERT_TRUE(decode_attributes_v1(stream, count, stride, out));
  for (size_t n = 0; n < stream.size(); ++n)
    EXPECT_FALSE(decode_attributes_v1(Bytes(stream.begin(), stream.begin() + ptrdiff_t(n)), count, stride, out)) << n;
  EXPECT_FALSE(decode_attributes_v1(stream, count - 1, stride, out)) << "bytes remain";
  for (uint8_t mode : {0x03, 0x10, 0x21}) {
    Bytes odd = stream;
    odd.back() = mode;
    EXPECT_FALSE(decode_attributes_v1(odd, count, stride, out)) << int(mode);
  }
}

TEST(MeshoptV1, ColorsOfTheFilter) {
  // r = y + co - cg, g = y + cg, b = y - co - cg, at 8 bits: alpha has 7 and its marker.
  Bytes eight = {100, 20, uint8_t(-30), 0x80 | 0x7f, 255, 0, 0, 0x80};
  decode_color_filter(eight, 4);
  EXPECT_EQ(eight, Bytes({150, 70, 110, 255, 255, 255, 255, 0}));
  // At 4 bits of 8: values of 15 become 255, the alpha 0b101 becomes 0b1011 of 15.
  Bytes four = {8, 3, uint8_t(-2), 0x08 | 0x05};
  decode_color_filter(four, 4);
  EXPECT_EQ(four, Bytes({221, 102, 119, 187}));
  // At 10 bits of 16.
  Bytes sixteen = {0x00, 0x02, 0, 0, 0xff, 0xff, 0xff, 0x03};  // y 512, cg -1, all of alpha
  decode_color_filter(sixteen, 8);
  uint16_t values[4];
  std::memcpy(values, sixteen.data(), sizeof values);
  EXPECT_EQ(values[0], 513u * 65535 / 1023 + 1);
  EXPECT_EQ(values[1], 511u * 65535 / 1023);
  EXPECT_EQ(values[2], values[0]);
  EXPECT_EQ(values[3], 65535);
}

TEST(MeshoptV1, IsReadFromFiles) {
  const Hills hills;
  MeshoptBuilder m = meshopt_file(hills, "KHR_meshopt_compression");
  Bytes positions(hills.positions.size() * sizeof(float));
  std::memcpy(positions.data(), hills.positions.data(), positions.size());
  const Bytes stream = encode_v1(positions, 12, {0x02, 0x12, 0x01}, [](size_t lane) { return unsigned(lane % 4); });
  const size_t view = m.view(stream, hills.count(), 12, "ATTRIBUTES");
  m.file.json["accessors"][0]["bufferView"] = view;
  const auto a = load_gltf(m.glb(), "a", ""), b = hills.plain().load();
  ASSERT_TRUE(a) << a.error().text();
  EXPECT_EQ(a->positions, b->positions);
}

}  // namespace
}  // namespace lambent
