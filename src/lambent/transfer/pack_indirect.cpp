// Direct-to-indirect transport as files keep it.
#include <lambent/core/half.h>
#include <lambent/transfer/indirect.h>
#include <lambent/transfer/shells.h>
#include <lambent/transfer/visibility.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr uint32_t last_place = (1u << 21) - 1, last_fold = 65535;

// A kernel's surfels that are in use, rising, and their weights in steps.
struct PackedKernel {
  std::array<uint32_t, kernel_slots> surfel{};
  std::array<int, kernel_slots> steps{};
  size_t count = 0;
};

PackedKernel packed(const IndirectTransfer& t, size_t receiver) {
  PackedKernel out;
  for (size_t k = receiver * kernel_slots; k < (receiver + 1) * kernel_slots; ++k) {
    const float steps = std::round(half_to_float(t.reader_weights[k]) / kernel_step);
    if (steps == 0) continue;
    const uint32_t surfel = t.reader_surfels[k];
    size_t at = out.count;
    while (at > 0 && out.surfel[at - 1] >= surfel) --at;
    if (at == out.count || out.surfel[at] != surfel) {
      for (size_t i = out.count++; i > at; --i) out.surfel[i] = out.surfel[i - 1], out.steps[i] = out.steps[i - 1];
      out.surfel[at] = surfel, out.steps[at] = 0;
    }
    out.steps[at] = std::clamp(out.steps[at] + int(steps), -127, 127);
  }
  return out;
}

}  // namespace

Bounds surfel_box(const Surfels& s) {
  Bounds box;
  for (Vec3 p : s.positions) box.extend(p);
  return box;
}

uint64_t pack_place(Vec3 p, const Bounds& box) {
  uint64_t out = 0;
  for (int c = 0; c < 3; ++c) {
    const double extent = double(box.max[c]) - double(box.min[c]);
    const double at = extent > 0 ? (double(p[c]) - double(box.min[c])) / extent : 0;
    out |= uint64_t(std::lround(std::clamp(at, 0.0, 1.0) * last_place)) << (21 * c);
  }
  return out;
}

Vec3 unpack_place(uint64_t packed, const Bounds& box) {
  Vec3 p;
  for (int c = 0; c < 3; ++c) {
    const uint32_t at = uint32_t(packed >> (21 * c)) & last_place;
    const double extent = double(box.max[c]) - double(box.min[c]);
    p[c] = at == last_place ? box.max[c] : float(double(box.min[c]) + extent * at / last_place);
  }
  return p;
}

uint32_t pack_normal(Vec3 n) {
  const Vec2 at = fold_octahedron(n);
  const auto round = [](float x) {
    return uint32_t(std::lround(std::clamp((x + 1) / 2, 0.0f, 1.0f) * float(last_fold)));
  };
  return round(at.x) | round(at.y) << 16;
}

Vec3 unpack_normal(uint32_t packed) {
  const float scale = 2 / float(last_fold);
  return unfold_octahedron({float(packed & last_fold) * scale - 1, float(packed >> 16) * scale - 1});
}

uint16_t pack_area(float area) {
  const uint32_t bits = __builtin_bit_cast(uint32_t, area);
  const uint32_t rounded = std::min((bits + 0x7fffu + (bits >> 16 & 1u)) >> 16, 0x7f7fu);  // the largest that is finite
  return uint16_t(std::max(rounded, 1u));
}

void round_surfels(Surfels& s) {
  const Bounds box = surfel_box(s);
  for (Vec3& p : s.positions) p = unpack_place(pack_place(p, box), box);
  for (Vec3& n : s.normals) n = unpack_normal(pack_normal(n));
  for (float& a : s.areas) a = unpack_area(pack_area(a));
  for (Vec3& a : s.albedos) a = each(a, [](float x) { return half_to_float(float_to_half(x)); });
}

void round_kernels(Kernels& k) {
  if (k.count == 0) return;
  const auto weights = std::span(k.weight).first(k.count);
  float sum = 0, rest = 0;
  size_t largest = 0;
  for (size_t i = 0; i < k.count; ++i) {
    sum += weights[i];
    if (weights[i] > weights[largest]) largest = i;
  }
  for (size_t i = 0; i < k.count; ++i)
    if (i != largest) {
      weights[i] = std::clamp(std::round(weights[i] / kernel_step), -127.0f, 127.0f) * kernel_step, rest += weights[i];
    }
  weights[largest] = std::clamp(std::round((sum - rest) / kernel_step), -127.0f, 127.0f) * kernel_step;
}

std::vector<uint8_t> pack_rows(const NodeRows& t) {
  std::vector<uint8_t> out;
  for (size_t r = 0; r + 1 < t.first.size(); ++r) {
    append_varint(out, t.first[r + 1] - t.first[r]);
    uint32_t last = 0;
    for (size_t e = t.first[r]; e < t.first[r + 1]; ++e) append_varint(out, t.nodes[e] - last), last = t.nodes[e];
  }
  return out;
}

Result<void> unpack_rows(std::span<const uint8_t> bytes, size_t rows, size_t most, NodeRows& out,
                         const std::string& where) {
  const Error broken{where, "the rows of the operator are broken"};
  size_t at = 0;
  out.first.assign(1, 0), out.nodes.clear();
  for (size_t r = 0; r < rows; ++r) {
    uint64_t count = 0, node = 0;
    if (!read_varint(bytes, at, count) || count > most - out.nodes.size()) return broken;
    for (uint64_t e = 0; e < count; ++e) {
      uint64_t step = 0;
      if (!read_varint(bytes, at, step) || step > 0xffffffffu - node) return broken;
      out.nodes.push_back(uint32_t(node += step));
    }
    out.first.push_back(uint32_t(out.nodes.size()));
  }
  if (at != bytes.size() || out.nodes.size() != most) return broken;
  return {};
}

std::vector<uint8_t> pack_kernels(const IndirectTransfer& t) {
  std::vector<uint8_t> out;
  PackedKernel before;
  for (size_t r = 0; r < t.receivers; ++r) {
    const PackedKernel k = packed(t, r);
    const auto begin = k.surfel.begin(), end = begin + ptrdiff_t(k.count);
    uint8_t again = 0;
    for (size_t i = 0; i < before.count; ++i)
      if (std::binary_search(begin, end, before.surfel[i])) again |= uint8_t(1u << i);
    std::vector<uint32_t> others;
    std::set_difference(begin, end, before.surfel.begin(), before.surfel.begin() + ptrdiff_t(before.count),
                        std::back_inserter(others));
    out.push_back(again), out.push_back(uint8_t(others.size()));
    uint32_t last = 0;
    for (uint32_t s : others) append_varint(out, s - last), last = s;
    for (size_t i = 0; i < k.count; ++i) out.push_back(uint8_t(int8_t(k.steps[i])));
    before = k;
  }
  return out;
}

Result<void> unpack_kernels(std::span<const uint8_t> bytes, IndirectTransfer& t, const std::string& where) {
  const Error broken{where, "the kernels of receivers are broken"};
  // Two bytes each at least.
  if (t.receivers > bytes.size() / 2) return broken;
  t.reader_surfels.assign(t.receivers * kernel_slots, 0), t.reader_weights.assign(t.receivers * kernel_slots, 0);
  std::array<uint32_t, kernel_slots> before{};
  size_t known = 0, at = 0;
  for (size_t r = 0; r < t.receivers; ++r) {
    if (bytes.size() - at < 2) return broken;
    const uint8_t again = bytes[at], others = bytes[at + 1];
    at += 2;
    std::array<uint32_t, kernel_slots> kept{}, added{}, surfel{};
    size_t had = 0, count = 0;
    if (again >> known || others > kernel_slots) return broken;
    for (size_t i = 0; i < known; ++i)
      if (again >> i & 1) kept[had++] = before[i];
    if (had + others > kernel_slots) return broken;
    uint64_t s = 0;
    for (size_t i = 0; i < others; ++i) {
      uint64_t step = 0;
      if (!read_varint(bytes, at, step) || step > 0xffffffffu - s) return broken;
      added[i] = uint32_t(s += step);
    }
    // Both rise.
    for (size_t i = 0, j = 0; i + j < had + others;)
      surfel[count++] = j == others || (i < had && kept[i] < added[j]) ? kept[i++] : added[j++];
    if (bytes.size() - at < count) return broken;
    for (size_t i = 0; i < count; ++i) {
      t.reader_surfels[r * kernel_slots + i] = surfel[i];
      t.reader_weights[r * kernel_slots + i] = float_to_half(float(int8_t(bytes[at++])) * kernel_step);
    }
    before = surfel, known = count;
  }
  if (at != bytes.size()) return broken;
  return {};
}

}  // namespace lambent
