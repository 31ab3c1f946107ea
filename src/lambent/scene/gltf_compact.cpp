// glTF 2.0 specification (ISO/IEC 12113): what refers to accessors and buffer views; EXT_mesh_gpu_instancing beside the
// core. Compressed views and primitives are plain since the document was read.
#include <lambent/scene/gltf_write.h>

#include <algorithm>
#include <functional>
#include <set>

namespace lambent {

using Json = nlohmann::json;

namespace {

// Extensions that name no accessor and no buffer view, or only those that visit_references() knows. KHR_materials_*,
// by their prefix, name textures alone.
const std::set<std::string> known_extensions{"KHR_animation_pointer",
                                             "KHR_lights_punctual",
                                             "KHR_mesh_quantization",
                                             "KHR_node_hoverability",
                                             "KHR_node_selectability",
                                             "KHR_node_visibility",
                                             "KHR_texture_basisu",
                                             "KHR_texture_transform",
                                             "KHR_xmp_json_ld",
                                             "EXT_lights_image_based",
                                             "EXT_mesh_gpu_instancing",
                                             "EXT_texture_avif",
                                             "EXT_texture_webp",
                                             "GODOT_single_root",
                                             "MSFT_lod",
                                             "MSFT_packing_normalRoughnessMetallic",
                                             "MSFT_packing_occlusionRoughnessMetallic",
                                             "MSFT_texture_dds"};

bool is_known(const std::string& name) { return name.starts_with("KHR_materials_") || known_extensions.contains(name); }

// Whether all extensions that stand anywhere in the document, listed or not, are known.
bool knows_extensions(const Json& value) {
  if (value.is_array()) return std::all_of(value.begin(), value.end(), knows_extensions);
  if (!value.is_object()) return true;
  for (auto item = value.begin(); item != value.end(); ++item) {
    if (item.key() == "extras") continue;
    if (item.key() == "extensions" && item->is_object()) {
      for (auto extension = item->begin(); extension != item->end(); ++extension)
        if (!is_known(extension.key())) return false;
    }
    if (!knows_extensions(*item)) return false;
  }
  return true;
}

bool uses_known_extensions(const Json& document) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const auto list = document.find(key);
    if (list == document.end()) continue;
    for (const Json& name : *list)
      if (!name.is_string() || !is_known(name.get<std::string>())) return false;
  }
  return knows_extensions(document);
}

enum class Target { accessor, view };
using Visit = std::function<void(Target, Json&)>;

void visit_one(Json& parent, std::initializer_list<const char*> path, Target target, const Visit& visit) {
  if (Json* value = gltf_member(parent, path)) visit(target, *value);
}
void visit_all(Json* object, const Visit& visit) {
  if (!object || !object->is_object()) return;
  for (Json& value : *object) visit(Target::accessor, value);
}
void each_of(Json& parent, const char* key, const std::function<void(Json&)>& work) {
  Json* items = gltf_member(parent, {key});
  if (!items || !items->is_array()) return;
  for (Json& item : *items) work(item);
}

// Every number of an accessor or of a buffer view in the document.
void visit_references(Json& document, const Visit& visit) {
  each_of(document, "meshes", [&](Json& mesh) {
    each_of(mesh, "primitives", [&](Json& primitive) {
      visit_all(gltf_member(primitive, {"attributes"}), visit);
      visit_one(primitive, {"indices"}, Target::accessor, visit);
      each_of(primitive, "targets", [&](Json& target) { visit_all(&target, visit); });
    });
  });
  each_of(document, "nodes", [&](Json& node) {
    visit_all(gltf_member(node, {"extensions", "EXT_mesh_gpu_instancing", "attributes"}), visit);
  });
  each_of(document, "skins", [&](Json& skin) { visit_one(skin, {"inverseBindMatrices"}, Target::accessor, visit); });
  each_of(document, "animations", [&](Json& animation) {
    each_of(animation, "samplers", [&](Json& sampler) {
      visit_one(sampler, {"input"}, Target::accessor, visit), visit_one(sampler, {"output"}, Target::accessor, visit);
    });
  });
  each_of(document, "images", [&](Json& image) { visit_one(image, {"bufferView"}, Target::view, visit); });
}
void visit_accessor(Json& accessor, const Visit& visit) {
  visit_one(accessor, {"bufferView"}, Target::view, visit);
  visit_one(accessor, {"sparse", "indices", "bufferView"}, Target::view, visit);
  visit_one(accessor, {"sparse", "values", "bufferView"}, Target::view, visit);
}

std::optional<size_t> whole(const Json& value, size_t limit) {
  GltfCheck check("");
  return check.integer(value, "", limit, {});
}

// Which items of the two lists are used; nullopt where a reference is none.
struct Used {
  std::vector<bool> accessors, views;
};
std::optional<Used> find_used(Json& document) {
  Used used{std::vector<bool>(gltf_count(document, "accessors")),
            std::vector<bool>(gltf_count(document, "bufferViews"))};
  bool sound = true;
  const Visit mark = [&](Target target, Json& value) {
    std::vector<bool>& list = target == Target::accessor ? used.accessors : used.views;
    const auto index = whole(value, list.size());
    if (index) list[*index] = true;
    sound = sound && index;
  };
  visit_references(document, mark);
  for (size_t i = 0; i < used.accessors.size(); ++i)
    if (used.accessors[i]) visit_accessor(document["accessors"][i], mark);
  return sound ? std::optional(std::move(used)) : std::nullopt;
}

// Takes the unused items out of a list; gives the new numbers of the others.
std::vector<size_t> shrink(Json& document, const char* key, const std::vector<bool>& used) {
  std::vector<size_t> numbers(used.size());
  Json kept = Json::array();
  for (size_t i = 0; i < used.size(); ++i) {
    numbers[i] = kept.size();
    if (used[i]) kept.push_back(std::move(document[key][i]));
  }
  if (kept.empty()) document.erase(key);
  else document[key] = std::move(kept);
  return numbers;
}

}  // namespace

void GltfWriter::compact() {
  compacted_ = false;
  if (!uses_known_extensions(json)) return;
  const std::optional<Used> used = find_used(json);
  if (!used) return;
  const size_t whole_size = size_;
  const auto range_of = [&](Json& holder) -> std::optional<Range> {
    const Json *offset = gltf_member(holder, {"byteOffset"}), *length = gltf_member(holder, {"byteLength"});
    const std::optional<size_t> at = offset ? whole(*offset, whole_size + 1) : 0,
                                size = length ? whole(*length, whole_size + 1) : std::nullopt;
    if (!at || !size || *size > whole_size - *at) return std::nullopt;
    return Range{*at, *at + *size};
  };
  bool sound = true;
  each_of(json, "bufferViews", [&](Json& holder) { sound = sound && range_of(holder); });
  if (!sound) return;

  const std::vector<size_t> accessors = shrink(json, "accessors", used->accessors),
                            views = shrink(json, "bufferViews", used->views);
  const Visit renumber = [&](Target target, Json& value) {
    const std::vector<size_t>& numbers = target == Target::accessor ? accessors : views;
    const size_t now = numbers[*whole(value, numbers.size())];
    if (value != now) value = now;
  };
  visit_references(json, renumber);
  each_of(json, "accessors", [&](Json& accessor) { visit_accessor(accessor, renumber); });
  std::vector<Range> ranges;
  each_of(json, "bufferViews", [&](Json& holder) { ranges.push_back(*range_of(holder)); });
  const std::vector<Move> moves = keep_bytes(std::move(ranges));
  compacted_ = true;
  each_of(json, "bufferViews", [&](Json& holder) {
    const size_t at = range_of(holder)->begin;
    const auto next = std::upper_bound(moves.begin(), moves.end(), at, [](size_t x, Move m) { return x < m.from; });
    const Move move = *std::prev(next);
    if (move.to != move.from) holder["byteOffset"] = move.to + (at - move.from);
  });
}

std::vector<GltfWriter::Move> GltfWriter::keep_bytes(std::vector<Range> ranges) {
  std::sort(ranges.begin(), ranges.end(), [](Range a, Range b) { return a.begin < b.begin; });
  std::vector<Range> runs;
  for (const Range& range : ranges) {
    if (!runs.empty() && range.begin <= runs.back().end) runs.back().end = std::max(runs.back().end, range.end);
    else runs.push_back(range);
  }
  // Each run keeps its place modulo 64, and with it the alignment of all that is in it: what was padding stays.
  std::vector<Move> moves;
  std::vector<Piece> pieces;
  size_t end = 0, piece = 0;
  for (const Range& run : runs) {
    const size_t to = end + (run.begin - end) % run_alignment;
    moves.push_back({run.begin, to});
    while (piece < pieces_.size() && pieces_[piece].offset + pieces_[piece].bytes.size() <= run.begin) ++piece;
    for (size_t p = piece; p < pieces_.size() && pieces_[p].offset < run.end; ++p) {
      const size_t first = std::max(run.begin, pieces_[p].offset),
                   last = std::min(run.end, pieces_[p].offset + pieces_[p].bytes.size());
      if (first < last)
        pieces.push_back(
            {to + (first - run.begin), pieces_[p].bytes.subspan(first - pieces_[p].offset, last - first), 4});
    }
    end = to + (run.end - run.begin);
  }
  pieces_ = std::move(pieces), size_ = end;
  return moves;
}

}  // namespace lambent
