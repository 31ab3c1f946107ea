#include <lambent/scene/meshopt_v1.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace lambent {
namespace {

constexpr size_t group_size = 16, largest_block = 256;

// Reads from the front; asking for more than there is gives an empty span, and ok() false from then on.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  std::span<const uint8_t> take(size_t count) {
    ok_ = ok_ && count <= bytes_.size();
    if (!ok_) return {};
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  bool ok() const { return ok_; }
  bool at_end() const { return ok_ && bytes_.empty(); }

 private:
  std::span<const uint8_t> bytes_;
  bool ok_ = true;
};

// Sixteen deltas of so many bits each; those of ones alone stand for a byte that follows.
void read_group(Reader& in, int bits, uint8_t* out) {
  std::fill_n(out, group_size, uint8_t(0));
  if (bits == 0) return;
  const std::span<const uint8_t> packed = in.take(group_size * size_t(bits) / 8);
  if (!in.ok()) return;
  const unsigned sentinel = (1u << bits) - 1;
  for (size_t i = 0; i < group_size; ++i) {
    const size_t bit = i * size_t(bits), shift = bits == 1 ? bit % 8 : 8 - size_t(bits) - bit % 8;
    const unsigned value = packed[bit / 8] >> shift & sentinel;
    out[i] = uint8_t(value);
    if (bits == 8 || value != sentinel) continue;
    const auto whole = in.take(1);
    if (!in.ok()) return;
    out[i] = whole[0];
  }
}

// The deltas of one byte of all elements of a block.
void read_lane(Reader& in, unsigned control, size_t count, uint8_t* out) {
  constexpr std::array<std::array<int, 4>, 2> widths{{{0, 1, 2, 4}, {1, 2, 4, 8}}};
  const size_t groups = (count + group_size - 1) / group_size;
  if (control == 2) {
    std::fill_n(out, count, uint8_t(0));
  } else if (control == 3) {
    const auto plain = in.take(count);
    if (in.ok()) std::copy(plain.begin(), plain.end(), out);
  } else {
    const auto headers = in.take((groups + 3) / 4);
    for (size_t g = 0; g < groups && in.ok(); ++g)
      read_group(in, widths[control][headers[g / 4] >> (2 * (g % 4)) & 3], out + g * group_size);
  }
}

template <class T>
T unzigzag(T v) {
  return T((v & 1) ? ~(v >> 1) : v >> 1);
}
template <class T>
T load(const uint8_t* p) {
  T v = 0;
  for (size_t i = 0; i < sizeof(T); ++i) v = T(v | T(p[i]) << (8 * i));
  return v;
}
template <class T>
void store(uint8_t* p, T v) {
  for (size_t i = 0; i < sizeof(T); ++i) p[i] = uint8_t(v >> (8 * i));
}

// Four bytes of an element from those of the one before it, in place.
void add_deltas(uint8_t mode, const uint8_t* deltas, uint8_t* last) {
  if (mode == 0)
    for (int k = 0; k < 4; ++k) last[k] = uint8_t(last[k] + unzigzag(deltas[k]));
  else if (mode == 1)
    for (int k = 0; k < 4; k += 2)
      store(last + k, uint16_t(load<uint16_t>(last + k) + unzigzag(load<uint16_t>(deltas + k))));
  else store(last, load<uint32_t>(last) ^ std::rotr(load<uint32_t>(deltas), mode >> 4));
}

}  // namespace

bool decode_attributes_v1(std::span<const uint8_t> stream, size_t count, size_t stride, std::vector<uint8_t>& out) {
  constexpr size_t header = 1, least_tail = 24, block_bytes = 8192;
  const size_t channels = stride / 4, tail = stride + channels, padded = std::max(tail, least_tail);
  if (stream.size() < header + padded) return false;
  const auto baseline = stream.last(tail).first(stride), modes = stream.last(channels);
  for (uint8_t mode : modes)
    if ((mode & 15) > 2 || ((mode & 15) < 2 && mode >> 4)) return false;
  std::vector<uint8_t> last(baseline.begin(), baseline.end()), lanes(stride * largest_block);
  Reader in(stream.subspan(header, stream.size() - header - padded));
  const size_t block = std::min(block_bytes / stride / group_size * group_size, largest_block);
  out.resize(count * stride);
  for (size_t first = 0; first < count; first += block) {
    const size_t n = std::min(block, count - first);
    const auto control = in.take(channels);
    for (size_t lane = 0; lane < stride && in.ok(); ++lane)
      read_lane(in, control[lane / 4] >> (2 * (lane % 4)) & 3, n, lanes.data() + lane * largest_block);
    if (!in.ok()) return false;
    for (size_t i = 0; i < n; ++i) {
      for (size_t c = 0; c < channels; ++c) {
        uint8_t deltas[4];
        for (size_t k = 0; k < 4; ++k) deltas[k] = lanes[(4 * c + k) * largest_block + i];
        add_deltas(modes[c], deltas, last.data() + 4 * c);
      }
      std::copy(last.begin(), last.end(), out.begin() + ptrdiff_t((first + i) * stride));
    }
  }
  return in.at_end();
}

namespace {

template <class Unsigned, class Signed>
void decode_colors(std::vector<uint8_t>& elements) {
  constexpr float full = float(std::numeric_limits<Unsigned>::max());
  for (size_t at = 0; at + 4 * sizeof(Unsigned) <= elements.size(); at += 4 * sizeof(Unsigned)) {
    Unsigned in[4];
    std::memcpy(in, elements.data() + at, sizeof in);
    const int scale = int(std::bit_ceil(unsigned(in[3]) + 1)) - 1;  // all ones, as wide as alpha with its marker
    const int y = in[0], co = Signed(in[1]), cg = Signed(in[2]), a = in[3] & scale >> 1;
    const int values[4] = {y + co - cg, y + cg, y - co - cg, a << 1 | (a & 1)};
    for (int c = 0; c < 4; ++c)
      in[c] = Unsigned(std::clamp(scale ? std::round(float(values[c]) * full / float(scale)) : 0.0f, 0.0f, full));
    std::memcpy(elements.data() + at, in, sizeof in);
  }
}

}  // namespace

void decode_color_filter(std::vector<uint8_t>& elements, size_t stride) {
  if (stride == 4) decode_colors<uint8_t, int8_t>(elements);
  else decode_colors<uint16_t, int16_t>(elements);
}

}  // namespace lambent
