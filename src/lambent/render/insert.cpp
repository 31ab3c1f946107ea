#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/render/insert.h>
#include <lambent/scene/append.h>

namespace lambent {
namespace {

// Appends b to a, which has one entry for each of `count` vertices or none at all; b counts from `first_receiver`.
void append_side(std::vector<uint32_t>& a, size_t count, const std::vector<uint32_t>& b, size_t added,
                 uint32_t first_receiver) {
  if (a.empty() && b.empty()) return;
  a.resize(count, none);
  for (uint32_t r : b) a.push_back(r == none ? none : r + first_receiver);
  a.resize(count + added, none);
}

}  // namespace

Result<void> check_insertion(const Outgoing& o, const std::string& path) {
  if (o.kind != OutgoingKind::map && o.kind != OutgoingKind::svd)
    return Error{path, std::string("objects cannot be inserted into a scene baked with outgoing rows of kind ") +
                           outgoing_names[int(o.kind)] + ", only with map or svd"};
  if (o.maps.size() > 65535) return Error{path, "has too many view maps to insert an object"};
  return {};
}

Result<void> insert_object(RelitScene& into, const Scene& object, const Receivers& receivers, const Transfer& transfer,
                           const Lattice& lattice, const Relit& light) {
  LAMBENT_CHECK(transfer.rows == 1 && transfer.receivers == receivers.count() &&
                transfer.columns() == size_t(light.rows));
  const size_t first = into.receivers, added = receivers.count(), vertices = into.scene.positions.size();
  LAMBENT_CHECK(first + added < none);
  if (into.outgoing) {
    Outgoing& o = *into.outgoing;
    if (auto ok = check_insertion(o, into.scene.path); !ok) return ok;
    // Lambert's law: the first row, times the colour, in every view.
    ViewMap lambert{2, into.relit.rows, std::vector<ViewWeights>(4 * size_t(into.relit.rows), ViewWeights(0.0f))};
    for (size_t node = 0; node < 4; ++node) lambert.values[node * size_t(into.relit.rows)] = ViewWeights(0, 0, 0, 1);
    o.maps.push_back(std::move(lambert));
    o.map_of.resize(first + added, uint16_t(o.maps.size() - 1));
    for (const Vec3& n : receivers.normals) o.frames.push_back(frame_about(n));
  }
  append_scene(into.scene, object);
  append_side(into.front, vertices, receivers.front, object.positions.size(), uint32_t(first));
  append_side(into.back, vertices, receivers.back, object.positions.size(), uint32_t(first));

  Relit& relit = into.relit;
  into.receivers = first + added;
  relit.values.resize((into.receivers + transfer_block - 1) / transfer_block * size_t(relit.rows) * 3 * transfer_block,
                      0.0f);
  parallel_for(added, transfer_block, [&](size_t begin, size_t end) {
    std::vector<Vec3> incident(size_t(light.rows));
    for (size_t r = begin; r < end; ++r) {
      interpolate_lattice(lattice, light, receivers.origins[r], incident);
      const std::vector<float> t = load_receiver(transfer, r);
      Vec3 exit(0.0f);
      for (int c = 0; c < 3; ++c) {
        const float* row = t.data() + size_t(std::min(c, transfer.channels - 1)) * incident.size();
        for (size_t i = 0; i < incident.size(); ++i) exit[c] += row[i] * incident[i][c];
      }
      relit.set(first + r, 0, exit);
      for (int row = 1; row < relit.rows; ++row) relit.set(first + r, row, Vec3(0.0f));
    }
  });
  return {};
}

}  // namespace lambent
