#include <lambent/core/check.h>
#include <lambent/transfer/blocks.h>
#include <lambent/transfer/zonal_texture.h>

#include <array>
#include <bit>

namespace lambent {
namespace {

constexpr char magic[8] = {'L', 'M', 'B', 'T', 'L', 'P', 'T', '1'};
constexpr uint8_t version_of_views = '2';
constexpr size_t header_size = 64;

// One value of one receiver.
float load_value(const ZonalTransfer& t, size_t receiver, size_t value) {
  const size_t at = (receiver / transfer_block * t.receiver_values() + value) * transfer_block +
                    receiver % transfer_block;
  if (t.precision == Precision::half) {
    uint16_t h;
    std::memcpy(&h, t.data.data() + 2 * at, 2);
    return half_to_float(h);
  }
  float f;
  std::memcpy(&f, t.data.data() + 4 * at, 4);
  return f;
}

}  // namespace

Result<void> save_zonal_texture(const std::string& path, const ZonalTexture& texture) {
  const ZonalTransfer& t = texture.transfer;
  LAMBENT_CHECK(t.receivers == size_t(texture.width) * size_t(texture.height) && t.data.size() == t.bytes());
  std::array<uint8_t, header_size> header{};
  LAMBENT_CHECK(t.rows == (texture.views ? texture.views * texture.views : 1));
  const uint32_t fields[9] = {uint32_t(texture.width),
                              uint32_t(texture.height),
                              uint32_t(t.order),
                              uint32_t(t.lobes),
                              uint32_t(t.channels),
                              uint32_t(t.value_bytes()),
                              uint32_t(texture.groove_depth > 0),
                              std::bit_cast<uint32_t>(texture.groove_depth),
                              uint32_t(texture.views)};
  std::memcpy(header.data(), magic, 8);
  if (texture.views) header[7] = version_of_views;
  std::memcpy(header.data() + 8, fields, sizeof fields);
  const std::span<const uint8_t> pieces[2] = {header, t.data};
  return write_file_atomically(path, pieces);
}

Result<ZonalTexture> load_zonal_texture(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return load_zonal_texture(*file, path);
}

Result<ZonalTexture> load_zonal_texture(const MappedFile& file, const std::string& path) {
  const std::span<const uint8_t> bytes = file.bytes();
  if (bytes.size() < header_size || std::memcmp(bytes.data(), magic, 7) != 0)
    return Error{path, "is not a texture of zonal lobes (make one with `lambent patch`)"};
  const bool seen = bytes[7] == version_of_views;
  if (!seen && bytes[7] != uint8_t(magic[7])) return Error{path, "is a texture of zonal lobes of another version"};
  uint32_t fields[9];
  std::memcpy(fields, bytes.data() + 8, sizeof fields);
  const auto [width, height, order, lobes, channels, value_bytes, kind, depth_bits, views] = std::to_array(fields);
  const float depth = std::bit_cast<float>(depth_bits);
  auto within = [](uint32_t x, uint32_t most) { return x >= 1 && x <= most; };
  if (!within(width, max_zonal_texture_size) || !within(height, max_zonal_texture_size))
    return Error{path, "its width or height is out of range"};
  if (!within(order, max_sh_order) || !within(lobes, max_stored_lobes) || (channels != 1 && channels != 3))
    return Error{path, "its order, lobes or channels are out of range"};
  if (value_bytes != 2 && value_bytes != 4) return Error{path, "its precision is not known to this program"};
  if (kind > 1) return Error{path, "is of a kind that is not known to this program"};
  if (kind == 1 && !(depth > 0 && depth <= 10 && width >= 2 && height >= 2))
    return Error{path, "its grooves have no depth, or too few places"};
  if (seen && (kind != 0 || views < 2 || views > uint32_t(max_texture_views)))
    return Error{path, "is seen from no number of views that is possible"};
  ZonalTexture texture;
  if (seen) texture.views = int(views), texture.transfer.rows = int(views * views);
  if (kind == 1) texture.groove_depth = depth;
  texture.width = int(width), texture.height = int(height);
  ZonalTransfer& t = texture.transfer;
  t.order = int(order), t.lobes = int(lobes), t.channels = int(channels), t.receivers = size_t(width) * height;
  t.precision = value_bytes == 2 ? Precision::half : Precision::single;
  if (bytes.size() - header_size != t.bytes())
    return Error{path, "holds " + std::to_string(bytes.size() - header_size) +
                           " bytes of values where its header makes " + std::to_string(t.bytes())};
  t.data = bytes.subspan(header_size);
  t.storage = std::make_shared<MappedFile>(file);
  return texture;
}

void sample_zonal_texture(const ZonalTexture& texture, Vec2 uv, std::span<float> values, size_t row) {
  const ZonalTransfer& t = texture.transfer;
  LAMBENT_CHECK(values.size() == t.row_values() && row < size_t(t.rows));
  const size_t first = row * t.row_values();
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) uv = Vec2(0.0f);
  uv -= floor(uv);
  const float x = uv.x * float(texture.width), y = uv.y * float(texture.height);
  auto wrap = [](int i, int n) { return (i + n) % n; };
  auto texel = [&](int i, int j) {
    return size_t(wrap(j, texture.height)) * size_t(texture.width) + size_t(wrap(i, texture.width));
  };
  const int i = int(std::floor(x - 0.5f)), j = int(std::floor(y - 0.5f));
  const float fx = x - 0.5f - float(i), fy = y - 0.5f - float(j);
  for (size_t k = 0; k < t.exact_values(); ++k)
    values[k] =
        (1 - fy) * ((1 - fx) * load_value(t, texel(i, j), first + k) + fx * load_value(t, texel(i + 1, j), first + k)) +
        fy *
            ((1 - fx) * load_value(t, texel(i, j + 1), first + k) + fx * load_value(t, texel(i + 1, j + 1), first + k));
  const size_t nearest = texel(std::min(int(x), texture.width - 1), std::min(int(y), texture.height - 1));
  for (size_t k = t.exact_values(); k < values.size(); ++k) values[k] = load_value(t, nearest, first + k);
}

void sample_groove(const ZonalTexture& table, float x, float depth, std::span<float> values) {
  const ZonalTransfer& t = table.transfer;
  LAMBENT_CHECK(values.size() == t.receiver_values() && table.groove_depth > 0);
  if (!(std::abs(x) < 0.5f)) x = 0.5f, depth = 0;
  auto place = [](float u, int n) { return std::isfinite(u) ? std::clamp(u, 0.0f, 1.0f) * float(n - 1) : 0.0f; };
  const float px = place(x + 0.5f, table.width), pd = place(depth / table.groove_depth, table.height);
  const int i = std::min(int(px), table.width - 2), j = std::min(int(pd), table.height - 2);
  const float fx = px - float(i), fd = pd - float(j);
  const size_t a = size_t(j * table.width + i), b = a + size_t(table.width);
  for (size_t k = 0; k < values.size(); ++k)
    values[k] = (1 - fd) * ((1 - fx) * load_value(t, a, k) + fx * load_value(t, a + 1, k)) +
                fd * ((1 - fx) * load_value(t, b, k) + fx * load_value(t, b + 1, k));
  for (int l = 0; l < t.lobes; ++l) {
    const Vec3 axis = lobe_axis(t, values, l);
    for (size_t k = 0; k < 3; ++k) values[t.exact_values() + size_t(l) * t.lobe_values() + k] = axis[int(k)];
  }
}

}  // namespace lambent
