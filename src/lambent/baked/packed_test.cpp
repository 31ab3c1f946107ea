// Files packed for browsers, decoded by the format's text and by nothing of the packer's: each number within half a
// step, all else to the bit; and bytes of a file that the page's own test decodes to the same
// (web/test/packed.test.ts).
#include <lambent/baked/packed.h>
#include <lambent/core/file.h>
#include <lambent/core/glb.h>
#include <lambent/core/half.h>
#include <lambent/core/huffman.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

namespace lambent {
namespace {

using PackJson = nlohmann::json;
using PackBytes = std::vector<uint8_t>;

template <class T>
PackBytes bytes_of_numbers(const std::vector<T>& values) {
  PackBytes out(values.size() * sizeof(T));
  if (!values.empty()) std::memcpy(out.data(), values.data(), out.size());
  return out;
}
template <class T>
std::vector<T> numbers_of_bytes(std::span<const uint8_t> bytes) {
  std::vector<T> out(bytes.size() / sizeof(T));
  if (!out.empty()) std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

// A .glb in pieces: what packing asks of a file, whichever scene made it.
struct Unpacked {
  PackJson document = {{"asset", {{"version", "2.0"}}},
                       {"buffers", {PackJson::object()}},
                       {"bufferViews", PackJson::array()},
                       {"accessors", PackJson::array()}};
  PackBytes binary;

  size_t add_view(const PackBytes& bytes) {
    binary.resize((binary.size() + 3) / 4 * 4);
    document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    return document["bufferViews"].size() - 1;
  }
  size_t add_accessor(size_t view, const char* type, int component, size_t count) {
    document["accessors"].push_back(
        {{"bufferView", view}, {"type", type}, {"componentType", component}, {"count", count}});
    return document["accessors"].size() - 1;
  }
  // `values` is [receiver][channel][column]; lamps are the last columns.
  void add_transfer(size_t receivers, size_t channels, size_t order, bool half, const std::vector<float>& values,
                    size_t lamps = 0) {
    const size_t width = channels * (order * order + lamps);
    std::vector<float> blocks((receivers + 15) / 16 * 16 * width);
    for (size_t r = 0; r < receivers; ++r)
      for (size_t k = 0; k < width; ++k) blocks[(r / 16 * width + k) * 16 + r % 16] = values[r * width + k];
    std::vector<uint16_t> halves;
    for (float v : blocks) halves.push_back(float_to_half(v));
    const size_t view = add_view(half ? bytes_of_numbers(halves) : bytes_of_numbers(blocks));
    document["extensions"]["LAMBENT_transfer"] = {{"version", 1},
                                                  {"parts", PackJson::array()},
                                                  {"transfer",
                                                   {{"kind", "diffuse"},
                                                    {"basis", "sh"},
                                                    {"order", order},
                                                    {"channels", channels},
                                                    {"receivers", receivers},
                                                    {"precision", half ? "half" : "single"},
                                                    {"bufferView", view}}}};
    if (lamps > 0)
      document["extensions"]["LAMBENT_transfer"]["transfer"]["groups"] = std::vector<std::string>(lamps, "lamp");
  }
  PackBytes glb() const {
    PackJson whole = document;
    whole["buffers"][0]["byteLength"] = binary.size();
    std::string text = whole.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    PackBytes padded = binary;
    padded.resize((padded.size() + 3) / 4 * 4);
    PackBytes out = bytes_of_numbers<uint32_t>(
        {0x46546c67u, 2u, uint32_t(28 + text.size() + padded.size()), uint32_t(text.size()), 0x4e4f534au});
    out.insert(out.end(), text.begin(), text.end());
    const PackBytes head = bytes_of_numbers<uint32_t>({uint32_t(padded.size()), 0x004e4942u});
    out.insert(out.end(), head.begin(), head.end());
    out.insert(out.end(), padded.begin(), padded.end());
    return out;
  }
};

// docs/file-format.md, "Packed for a browser", read front to back.
struct Unpacker {
  std::span<const uint8_t> bytes;
  size_t at = 0;

  uint8_t byte() { return bytes[at++]; }
  uint32_t word() {
    uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value |= uint32_t(byte()) << (8 * i);
    return value;
  }
  PackBytes coded() {
    const uint32_t count = word(), length = word();
    auto symbols = huffman_decode(bytes.subspan(at, length), count);
    at += length;
    EXPECT_TRUE(symbols);
    return symbols.value_or(PackBytes(count));
  }
  std::vector<uint32_t> numbers(size_t count) {  // mod 2^32
    std::vector<uint32_t> out;
    const PackBytes symbols = coded();
    for (size_t i = 0; i < symbols.size();) {
      uint32_t folded = symbols[i++];
      if (folded > 251) {
        const uint32_t n = folded - 251;
        folded = 0;
        for (uint32_t k = 0; k < n; ++k) folded |= uint32_t(symbols[i++]) << (8 * k);
      }
      out.push_back(folded % 2 ? ~(folded / 2) : folded / 2);
    }
    EXPECT_EQ(out.size(), count);
    out.resize(count);
    return out;
  }
  // [row][group][column], zero in columns that are not in `order`.
  std::vector<int32_t> rows(size_t count, size_t groups, size_t columns, const std::vector<size_t>& order) {
    const PackBytes parents = coded();
    EXPECT_EQ(parents.size(), count);
    std::vector<int32_t> out(count * groups * columns);
    std::vector<uint32_t> first;
    for (size_t c : order)
      for (size_t g = 0; g < groups; ++g) {
        const uint8_t way = byte();
        std::vector<uint32_t> values = numbers(count);
        for (size_t r = 0; r < count; ++r)
          if (way % 2 && parents[r]) values[r] += values[r - parents[r]];
        for (size_t r = 0; r < count; ++r)
          if (way / 2) values[r] += first[r];
        if (g == 0) first = values;
        for (size_t r = 0; r < count; ++r) out[(r * groups + g) * columns + c] = int32_t(values[r]);
      }
    return out;
  }
};

// The order that columns come in; of the first bands and lamps, where those are asked for.
std::vector<size_t> columns_of(const PackJson& packed, bool first_alone) {
  const size_t columns = packed["columns"];
  std::vector<size_t> out;
  const PackJson first = packed.value("first", PackJson{{"order", 100}, {"lamps", 0}});
  const size_t bands = std::min(columns, first["order"].get<size_t>() * first["order"].get<size_t>()),
               lamps = first["lamps"];
  for (size_t c = 0; c < bands; ++c) out.push_back(c);
  for (size_t c = columns - lamps; c < columns; ++c) out.push_back(c);
  for (size_t c = bands; c < columns - lamps && !first_alone; ++c) out.push_back(c);
  return out;
}

PackBytes unpacked(std::span<const uint8_t> bytes, const PackJson& packed, bool first_alone = false) {
  Unpacker from{bytes};
  const std::string form = packed["form"];
  const size_t length = packed["byteLength"];
  const auto number = [&](const char* key) { return packed[key].get<size_t>(); };
  PackBytes out;
  if (form == "u16" || form == "u32") {
    const size_t size = form == "u16" ? 2 : 4, lag = from.byte();
    std::vector<uint32_t> values = from.numbers(length / size);
    for (size_t i = lag; lag > 0 && i < values.size(); ++i) values[i] += values[i - lag];
    for (uint32_t v : values)
      for (size_t k = 0; k < size; ++k) out.push_back(uint8_t(v >> (8 * k)));
  } else if (form == "floats") {
    const size_t columns = number("columns");
    std::vector<float> values;
    for (int32_t v : from.rows(length / 4 / columns, 1, columns, columns_of(packed, false)))
      values.push_back(float(v) * packed["step"].get<float>());
    out = bytes_of_numbers(values);
  } else {
    const size_t rows = number("rows"), width = number("groups") * number("columns");
    const std::vector<int32_t> steps =
        from.rows(rows, number("groups"), number("columns"), columns_of(packed, first_alone));
    std::vector<float> values((rows + 15) / 16 * 16 * width);
    for (size_t r = 0; r < rows; ++r)
      for (size_t k = 0; k < width; ++k)
        values[(r / 16 * width + k) * 16 + r % 16] = float(steps[r * width + k]) * packed["step"].get<float>();
    std::vector<uint16_t> halves;
    for (float v : values) halves.push_back(float_to_half(v));
    out = form == "half blocks" ? bytes_of_numbers(halves) : bytes_of_numbers(values);
  }
  EXPECT_EQ(from.at, bytes.size());
  EXPECT_EQ(out.size(), length);
  return out;
}

// A packed file, its views as they were before.
struct Packed {
  PackJson document, extension;
  std::vector<PackBytes> views;
  float error = 0;

  explicit Packed(std::string_view file) {
    auto chunks = split_gltf({reinterpret_cast<const uint8_t*>(file.data()), file.size()}, "packed.glb");
    EXPECT_TRUE(chunks);
    document = chunks->json;
    extension = document["extensions"]["LAMBENT_transfer"];
    error = extension["packed"]["error"];
    for (const PackJson& view : document["bufferViews"]) {
      const auto own = chunks->binary.subspan(view["byteOffset"], view["byteLength"]);
      views.push_back(view.contains("extensions") ? unpacked(own, view["extensions"]["LAMBENT_transfer"])
                                                  : PackBytes(own.begin(), own.end()));
    }
  }
  const PackJson& description(size_t view) const {
    return document["bufferViews"][view]["extensions"]["LAMBENT_transfer"];
  }
  bool is_packed(size_t view) const { return document["bufferViews"][view].contains("extensions"); }
  size_t transfer() const { return extension["transfer"]["bufferView"]; }
};

std::string pack_refusal(const Unpacked& file, float error = 0.01f) {
  const auto packed = pack_baked(file.glb(), error, "bake.glb");
  return packed ? "" : packed.error().text();
}
Packed packed_of(const Unpacked& file, float error) {
  auto packed = pack_baked(file.glb(), error, "bake.glb");
  if (!packed) ADD_FAILURE() << packed.error().text();
  Packed out(packed->bytes);
  EXPECT_EQ(out.error, packed->error);
  return out;
}

// The same on every machine: triangle waves in steps of 1/64, weaker by the column.
int wave(int x, int period) { return std::abs(x % (2 * period) - period); }
std::vector<float> made_up(size_t receivers, size_t channels, size_t columns) {
  std::vector<float> values;
  for (size_t r = 0; r < receivers; ++r)
    for (size_t g = 0; g < channels; ++g)
      for (size_t c = 0; c < columns; ++c)
        values.push_back(float(wave(int(r + 5 * g), 7 + int(c)) + wave(int(r / 40), 9) - 8) / float(64 << (c / 3)));
  return values;
}

// A grid of vertices with transfer, receivers and indices.
Unpacked grid_file(size_t side, size_t channels, bool half, size_t order = 4, size_t lamps = 2) {
  const size_t count = side * side;
  Unpacked file;
  std::vector<float> places, normals, coordinates;
  std::vector<uint32_t> receivers, corners;
  for (size_t i = 0; i < count; ++i) {
    places.insert(places.end(), {float(i % side) / 8, float(wave(int(i), 11)) / 32, float(i / side) / 8});
    normals.insert(normals.end(), {float(wave(int(i), 3)) / 8 - 0.25f, 0.9375f, 0.125f});
    coordinates.insert(coordinates.end(), {float(i % side) / float(side), float(i / side) / float(side)});
    receivers.push_back(i % 7 == 3 ? 0xffffffffu : uint32_t(count - 1 - i));
  }
  for (uint32_t i = 0; i + side + 1 < count; ++i) corners.insert(corners.end(), {i, i + uint32_t(side), i + 1});
  file.add_transfer(count, channels, order, half, made_up(count, channels, order * order + lamps), lamps);
  const auto attribute = [&](const std::vector<float>& values, const char* type, size_t components) {
    return file.add_accessor(file.add_view(bytes_of_numbers(values)), type, 5126, values.size() / components);
  };
  PackJson attributes;
  attributes["POSITION"] = attribute(places, "VEC3", 3);
  file.document["accessors"].back().update({{"min", {0, 0, 0}}, {"max", {double(side) / 8, 1, double(side) / 8}}});
  attributes["NORMAL"] = attribute(normals, "VEC3", 3);
  attributes["TEXCOORD_0"] = attribute(coordinates, "VEC2", 2);
  const size_t indices = file.add_accessor(file.add_view(bytes_of_numbers(corners)), "SCALAR", 5125, corners.size());
  file.document["meshes"] = {{{"primitives", {{{"attributes", attributes}, {"indices", indices}}}}}};
  file.document["extensions"]["LAMBENT_transfer"]["parts"] = {
      {{"node", 0}, {"primitive", 0}, {"front", file.add_view(bytes_of_numbers(receivers))}}};
  file.add_view({1, 2, 3, 4, 5, 6, 7});  // which nothing is known of
  return file;
}

PackBytes view_before(const Unpacked& file, size_t i) {
  const PackJson& view = file.document["bufferViews"][i];
  const auto begin = file.binary.begin() + view["byteOffset"].get<ptrdiff_t>();
  return {begin, begin + view["byteLength"].get<ptrdiff_t>()};
}
std::vector<float> floats_of(const PackBytes& bytes, bool half) {
  if (!half) return numbers_of_bytes<float>(bytes);
  std::vector<float> out;
  for (uint16_t h : numbers_of_bytes<uint16_t>(bytes)) out.push_back(half_to_float(h));
  return out;
}

TEST(Packed, TransferIsWithinHalfAStepInEveryColumnAndAsFarOffAsIsStated) {
  for (const bool half : {true, false})
    for (const size_t channels : {1, 3})
      for (const float asked : {0.001f, 0.01f, 0.05f}) {
        const Unpacked file = grid_file(30, channels, half);
        const Packed packed = packed_of(file, asked);
        const size_t view = packed.transfer(), width = 18 * channels;
        ASSERT_TRUE(packed.is_packed(view));
        const auto before = floats_of(view_before(file, view), half), after = floats_of(packed.views[view], half);
        ASSERT_EQ(before.size(), after.size());
        const double step = packed.description(view)["step"];
        std::vector<double> most(width), last(width);
        double off = 0, all = 0;
        for (size_t i = 0; i < before.size(); ++i) {
          const double apart = std::abs(double(after[i]) - before[i]);
          double& column = most[i / 16 % width];
          column = std::max(column, apart - (half ? std::abs(after[i]) / 2048 : 1e-6));  // what a half rounds
          off += apart * apart, all += double(before[i]) * before[i];
        }
        for (size_t c = 0; c < width; ++c) EXPECT_LE(most[c], step / 2) << "column " << c << ", " << asked;
        EXPECT_NEAR(std::sqrt(off / all), packed.error, 1e-6);
        EXPECT_NEAR(packed.error, asked, 0.3 * asked);
        for (size_t i = before.size() / 16 / width * 16 * width - 16 * width; i < before.size(); ++i)
          if (const size_t r = i / 16 / width * 16 + i % 16; r >= 900) EXPECT_EQ(after[i], 0);  // beyond the last
      }
}

TEST(Packed, TheFirstBandsAndLampsComeBeforeTheOtherBandsAndAllElseBeforeThem) {
  const Unpacked file = grid_file(30, 3, true);
  auto bytes = pack_baked(file.glb(), 0.01f, "bake.glb");
  ASSERT_TRUE(bytes);
  const Packed packed(bytes->bytes);
  const PackJson& views = packed.document["bufferViews"];
  const size_t view = packed.transfer(), begin = views[view]["byteOffset"];
  for (size_t i = 0; i < views.size(); ++i)
    if (i != view) EXPECT_LE(views[i]["byteOffset"].get<size_t>() + views[i]["byteLength"].get<size_t>(), begin) << i;
  const PackJson first = packed.description(view)["first"];
  EXPECT_EQ(first["order"], 3);
  EXPECT_EQ(first["lamps"], 2);
  const size_t length = first["byteLength"], whole = views[view]["byteLength"];
  EXPECT_LT(length, whole * 4 / 5);
  // Those bytes alone make the same numbers, with zeros for what is to come.
  const auto chunks = split_gltf({reinterpret_cast<const uint8_t*>(bytes->bytes.data()), bytes->bytes.size()}, "");
  const auto alone =
      numbers_of_bytes<uint16_t>(unpacked(chunks->binary.subspan(begin, length), packed.description(view), true));
  const auto all = numbers_of_bytes<uint16_t>(packed.views[view]);
  for (size_t i = 0; i < all.size(); ++i) {
    const size_t column = i / 16 % 18;
    ASSERT_EQ(alone[i], column < 9 || column >= 16 ? all[i] : 0) << i;
  }
  // Of three bands there is nothing to come.
  for (const size_t lamps : {0, 2}) {
    const Packed few = packed_of(grid_file(30, 3, true, 3, lamps), 0.01f);
    EXPECT_TRUE(few.is_packed(few.transfer()));
    EXPECT_FALSE(few.description(few.transfer()).contains("first"));
  }
}

TEST(Packed, VerticesAreWithinTheirStepsAndAllElseIsTheSame) {
  const Unpacked file = grid_file(30, 3, true);
  const Packed packed = packed_of(file, 0.01f);
  // Transfer, positions, normals, coordinates, indices, receivers, what nothing is known of.
  const double steps[] = {0, 1.0 / 16384, 1.0 / 1024, 1.0 / 32768, 0, 0, 0};  // the grid is 3.75 wide: 2 / 2^15
  ASSERT_EQ(packed.views.size(), 7u);
  for (size_t i = 1; i < 7; ++i) {
    const PackBytes before = view_before(file, i);
    ASSERT_EQ(packed.views[i].size(), before.size());
    EXPECT_EQ(packed.is_packed(i), i < 6);
    if (steps[i] == 0) {
      EXPECT_EQ(packed.views[i], before) << i;
      continue;
    }
    EXPECT_EQ(packed.description(i)["step"].get<double>(), steps[i]);
    const auto a = numbers_of_bytes<float>(before), b = numbers_of_bytes<float>(packed.views[i]);
    for (size_t k = 0; k < a.size(); ++k) ASSERT_LE(std::abs(a[k] - b[k]), steps[i] / 2) << i << " " << k;
  }
  EXPECT_EQ(packed.document["extensionsRequired"], PackJson({"LAMBENT_transfer"}));
  EXPECT_EQ(packed.document["accessors"], file.document["accessors"]);
  EXPECT_EQ(packed.document["meshes"], file.document["meshes"]);
}

TEST(Packed, IntegersOfAllSizesComeBack) {
  Unpacked file;
  file.add_transfer(16, 1, 1, true, std::vector<float>(16, 1));
  std::vector<uint32_t> words;
  for (uint32_t i = 0; i < 5000; ++i) words.push_back(i % 3 ? i : (i * i * 2654435761u) >> (i % 32));
  words.insert(words.end(), {0, 0xffffffffu, 0x7fffffffu, 0x80000000u, 1});
  words.resize(8000, 5);
  const size_t view = file.add_view(bytes_of_numbers(words));
  file.document["extensions"]["LAMBENT_transfer"]["parts"] = {{{"node", 0}, {"primitive", 0}, {"front", view}}};
  const Packed packed = packed_of(file, 0.01f);
  EXPECT_TRUE(packed.is_packed(view));
  EXPECT_EQ(packed.views[view], bytes_of_numbers(words));
}

TEST(Packed, OneReceiverAColumnThatIsTheSameAndZerosArePackedOrStayAsTheyAre) {
  Unpacked one;
  one.add_transfer(1, 3, 2, false, std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12});
  const Packed small = packed_of(one, 0.1f);
  EXPECT_FALSE(small.is_packed(small.transfer()));  // codes alone are longer
  EXPECT_EQ(small.views[small.transfer()], view_before(one, small.transfer()));
  EXPECT_EQ(small.error, 0);

  for (const float value : {1.0f, -0.3f, 1e-30f, 1e30f, 0.0f}) {
    Unpacked same;
    same.add_transfer(4000, 1, 2, false, std::vector<float>(16000, value));
    const Packed packed = packed_of(same, 0.01f);
    ASSERT_TRUE(packed.is_packed(packed.transfer()));
    for (float v : numbers_of_bytes<float>(packed.views[packed.transfer()]))
      EXPECT_NEAR(v / (value != 0 ? value : 1), value != 0 ? 1 : 0, 0.0174) << value;  // half of 0.01 times sqrt(12)
    EXPECT_LE(packed.error, 0.0174f);
    EXPECT_LT(packed.document["bufferViews"][packed.transfer()]["byteLength"].get<size_t>(), 5000u);
  }

  // What is too little to have a step of its own is none.
  Unpacked least;
  std::vector<float> few(16000);
  for (size_t i = 0; i < few.size(); i += 3) few[i] = 1e-44f;
  least.add_transfer(4000, 1, 2, false, few);
  const Packed none = packed_of(least, 0.01f);
  EXPECT_EQ(none.views[none.transfer()], PackBytes(64000));
  EXPECT_EQ(none.error, 1);

  // One number stands out: it is within half a step as all others are.
  Unpacked peak;
  std::vector<float> values(64000, 1e-3f);
  values[777] = 1000;
  peak.add_transfer(16000, 1, 2, false, values);
  const Packed packed = packed_of(peak, 1e-5f);
  const auto after = numbers_of_bytes<float>(packed.views[packed.transfer()]);
  EXPECT_NEAR(*std::max_element(after.begin(), after.end()), 1000, 0.5 * packed.description(0)["step"].get<double>());
}

TEST(Packed, WhatCannotBePackedIsRefusedInALine) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  for (const bool half : {true, false})
    for (const float value : {nan, infinity, -infinity}) {
      Unpacked file;
      std::vector<float> values(64, 1);
      values[37] = value;
      file.add_transfer(16, 1, 2, half, values);
      EXPECT_EQ(pack_refusal(file), "bake.glb: holds transfer that is not a finite number");
    }
  const Unpacked file = grid_file(8, 1, true);
  for (const float error : {0.0f, -1.0f, 0.2f, nan, 1e-9f})
    EXPECT_EQ(pack_refusal(file, error), "bake.glb: --pack takes an error from 0.00001 to 0.1");
  Unpacked longer = file;
  longer.document["extensions"]["LAMBENT_transfer"]["transfer"]["receivers"] = 640;
  EXPECT_EQ(pack_refusal(longer), "bake.glb: holds transfer of another length than its header makes");
  for (const PackJson& change : {PackJson{{"buffer", 1}}, PackJson{{"byteOffset", 1u << 30}},
                                 PackJson{{"byteLength", 1u << 30}}, PackJson{{"extensions", {{"X", 1}}}}}) {
    Unpacked elsewhere = file;
    elsewhere.document["bufferViews"][1].update(change);
    EXPECT_NE(pack_refusal(elsewhere).find("one is compressed or elsewhere"), std::string::npos) << change;
  }
  for (const char* key : {"cpca", "lobes"}) {
    Unpacked other = file;
    other.document["extensions"]["LAMBENT_transfer"]["transfer"][key] = 1;
    EXPECT_NE(pack_refusal(other).find("--pack takes dense transfer"), std::string::npos);
  }
  // Vertices that are no numbers stay as they are: files of others may have them.
  Unpacked odd = file;
  std::memcpy(odd.binary.data() + odd.document["bufferViews"][1]["byteOffset"].get<size_t>(), &nan, 4);
  EXPECT_EQ(packed_of(odd, 0.01f).views[1], view_before(odd, 1));
}

TEST(Packed, WritesTheBytesThatThePageIsTestedWith) {
  const auto packed = pack_baked(grid_file(30, 3, true).glb(), 0.01f, "bake.glb");
  ASSERT_TRUE(packed);
  const std::string folder = std::string(LAMBENT_GOLDEN) + "/../packed";
  const auto kept = MappedFile::open(folder + "/grid.glb");
  const bool same = kept && std::string_view(reinterpret_cast<const char*>(kept->bytes().data()),
                                             kept->bytes().size()) == packed->bytes;
  const std::string now = testing::TempDir() + "/lambent_packed_grid.glb";
  if (!same) std::ofstream(now, std::ios::binary) << packed->bytes;
  EXPECT_TRUE(same) << "what is written now is in " << now;
  // FNV-1a of each view, and of transfer of which the first bands alone are there.
  const auto hash_of = [](const PackBytes& view) {
    uint32_t hash = 2166136261u;
    for (uint8_t b : view) hash = (hash ^ b) * 16777619u;
    return hash;
  };
  PackJson hashes;
  const Packed file(packed->bytes);
  for (const PackBytes& view : file.views) hashes["views"].push_back(hash_of(view));
  const PackJson& description = file.description(file.transfer());
  const auto chunks = split_gltf({reinterpret_cast<const uint8_t*>(packed->bytes.data()), packed->bytes.size()}, "");
  const auto first = chunks->binary.subspan(file.document["bufferViews"][file.transfer()]["byteOffset"],
                                            description["first"]["byteLength"]);
  hashes["first"] = hash_of(unpacked(first, description, true));
  const auto values = MappedFile::open(folder + "/grid.json");
  ASSERT_TRUE(values);
  EXPECT_EQ(hashes, PackJson::parse(values->bytes().begin(), values->bytes().end()));
}

}  // namespace
}  // namespace lambent
