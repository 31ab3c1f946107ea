// Follows: radiosity, "Problem Size". Jacobi within a room, Gauss-Seidel over rooms.
#include <lambent/bake/rooms.h>

#include <lambent/bake/block_builder.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/kept_rows.h>
#include <lambent/bake/room_space.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>
#include <lambent/scene/see_through.h>

#include <atomic>
#include <chrono>
#include <cmath>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

constexpr int first_rays = 256;      // a receiver, which find the nodes
constexpr int most_generations = 6;  // of nodes that rays of nodes find
constexpr int inner_most = 6;        // iterations within a room at a visit
constexpr size_t padded(size_t n) { return (n + gather_block - 1) / gather_block * gather_block; }

struct RowScratch {
  BlockBuilder rows;
  AlignedVector<float> x, y, z;
  std::vector<Hit> hits;
  std::vector<float> harmonics, sky;
};

struct RoomBaker {
  const Scene& scene;
  const Receivers& receivers;
  const BakeOptions& options;
  const RoomsOptions& how;
  RoomSpace space;
  BakeReport& report;
  RoomsReport& told;
  Progress* progress;

  const CornerReceivers& basis = std::get<CornerReceivers>(receivers.basis);
  const DirectionSets sets = make_direction_sets(std::max(options.order, 1), options.samples, 8, options.seed);
  const size_t coefficients = size_t(sh_count(options.order));
  const int channels = has_coloured_albedo(scene) ? 3 : 1;
  const size_t width = pad_lanes(coefficients * size_t(channels));
  const float weight_unit = std::min(1.0f, 16384.0f / float(options.samples));
  std::vector<std::vector<uint32_t>> receivers_of{};  // of each room
  std::vector<size_t> first_row{};  // of each room: its receivers, padded, then nodes of openings into it, padded
  std::vector<size_t> node_row{};   // of each room: the first of the nodes
  std::vector<uint32_t> row_of{};   // of each receiver
  size_t rows = 0;
  std::vector<float> e{};         // [row][coefficient]
  AlignedVector<float> x{};       // [row][coefficient][channel]
  std::vector<uint8_t> buried{};  // of receivers
  std::vector<FillStep> fill{};
  std::unique_ptr<KeptRows> kept{};
  std::atomic<size_t> crossed{0}, lost{0};
  std::atomic<bool> traced_anew{false};

  size_t n() const { return receivers.count(); }
  size_t room_count() const { return space.rooms.size(); }
  size_t receiver_blocks(size_t room) const { return padded(receivers_of[room].size()) / gather_block; }
  size_t rooms_end(size_t room) const { return room + 1 < room_count() ? first_row[room + 1] : rows; }

  void assign_receivers() {
    receivers_of.assign(room_count(), {});
    for (uint32_t r = 0; r < n(); ++r) receivers_of[space.room_at(receivers.origins[r])].push_back(r);
    for (const auto& own : receivers_of) told.largest = std::max(told.largest, own.size());
  }

  // Nodes that rays of receivers end at, by a few of them, and those that rays of nodes do, generation by generation.
  Result<void> find_nodes() {
    ProgressStage stage(progress, "finding openings", room_count());
    const DirectionSets few = make_direction_sets(1, first_rays, 8, uint32_t(hash64(options.seed, 0x726f6f6d)));
    std::vector<std::vector<uint32_t>> fresh(room_count());  // nodes whose rays have not been followed, by room
    for (size_t room = 0; room < room_count(); ++room, stage.advance()) {
      if (stage.cancelled()) return Error{"", "cancelled"};
      auto geometry = space.geometry(room, scene);
      if (!geometry) return geometry.error();
      const auto& own = receivers_of[room];
      std::vector<std::vector<Crossing>> found((own.size() + gather_block - 1) / gather_block);
      parallel_for(own.size(), gather_block, [&](size_t begin, size_t end) {
        AlignedVector<float> dx(few.stride), dy(few.stride), dz(few.stride);
        std::vector<Hit> hits(first_rays);
        for (size_t i = begin; i < end; ++i) {
          const uint32_t r = own[i];
          const DirectionChoice c = choose_directions(few, receivers.normals[r], options.seed, r);
          const size_t base = size_t(c.set) * few.stride;
          rotate_directions(c.rotation, few.x.data() + base, few.y.data() + base, few.z.data() + base, few.stride,
                            dx.data(), dy.data(), dz.data());
          geometry->tracer.closest_fan(receivers.origins[r], {dx.data(), dy.data(), dz.data(), first_rays},
                                       hits.data());
          for (size_t j = 0; j < first_rays; ++j) {
            const Exit exit = space.exit(room, receivers.origins[r], {dx[j], dy[j], dz[j]}, hits[j]);
            if (exit.opening != none) found[begin / gather_block].push_back({exit, uint32_t(hash64(r, j))});
          }
        }
      });
      for (const auto& block : found)
        for (const Crossing& c : block) space.take(c, fresh);
    }
    for (int generation = 0; generation < most_generations; ++generation) {
      std::vector<std::vector<uint32_t>> now(room_count());
      now.swap(fresh);
      for (size_t room = 0; room < room_count(); ++room) {
        if (now[room].empty()) continue;
        if (stage.cancelled()) return Error{"", "cancelled"};
        auto geometry = space.geometry(room, scene);
        if (!geometry) return geometry.error();
        std::vector<std::vector<Crossing>> found((now[room].size() + gather_block - 1) / gather_block);
        parallel_for(now[room].size(), gather_block, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i)
            for (const NodeRay& ray : space.rays_of(now[room][i])) {
              const Exit exit =
                  space.exit(room, ray.origin, ray.direction, geometry->tracer.closest(ray.origin, ray.direction));
              if (exit.opening != none)
                found[begin / gather_block].push_back({exit, uint32_t(hash64(now[room][i], ray.key))});
            }
        });
        for (const auto& block : found)
          for (const Crossing& c : block) space.take(c, fresh);
      }
    }
    space.number_nodes();
    return {};
  }

  void number_rows() {
    first_row.resize(room_count()), node_row.resize(room_count()), row_of.resize(n());
    rows = 0;
    for (size_t room = 0; room < room_count(); ++room) {
      first_row[room] = rows;
      for (size_t i = 0; i < receivers_of[room].size(); ++i) row_of[receivers_of[room][i]] = uint32_t(rows + i);
      rows += padded(receivers_of[room].size());
      node_row[room] = rows;
      rows += padded(space.nodes_of[room].size());
    }
    told.rooms = room_count(), told.openings = space.openings.size(), told.nodes = space.node_count();
  }

  Vec3 albedo_of(uint32_t triangle, const Corners& at, const Hit& hit) const {
    const Material& m = scene.materials[scene.parts[at.part].material];
    return m.base_color_texture >= 0 || !scene.colors.empty() ? albedo(scene, scene.triangles[triangle], hit.u, hit.v)
                                                              : m.base_color;
  }

  // One ray into the row at hand.
  void add_ray(size_t room, const RoomGeometry& geometry, Vec3 origin, Vec3 direction, const Hit& hit, RowScratch& s,
               size_t& backs) {
    const Exit exit = space.exit(room, origin, direction, hit);
    if (exit.opening != none) {
      ++crossed;
      const uint32_t node = space.find_node(exit);
      if (node == none) ++lost;
      else s.rows.add(uint32_t(node_row[space.openings[exit.opening].beyond] + node), Vec3(1));
      return;
    }
    if (exit.outside) {
      evaluate_sh(options.order, direction, s.harmonics);
      for (size_t k = 0; k < coefficients; ++k) s.sky[k] += s.harmonics[k];
      return;
    }
    const uint32_t triangle = geometry.triangles[hit.triangle];
    const Corners* at = basis.find(triangle, hit.front);
    if (!at) {
      ++backs;
      return;
    }
    const Vec3 rho = albedo_of(triangle, *at, hit);
    basis.spread(*at, hit.u, hit.v, [&](uint32_t r, float weight) { s.rows.add(row_of[r], weight * rho); });
  }

  // Block b of a room; where `first`, its e and who is buried, too. The number of rays that a row averages.
  size_t trace_block(size_t room, const RoomGeometry& geometry, size_t b, bool first, RowScratch& s, SparseBlock& out) {
    const bool of_nodes = b >= receiver_blocks(room);
    const size_t begin = (of_nodes ? b - receiver_blocks(room) : b) * gather_block;
    const size_t all = of_nodes ? space.nodes_of[room].size() : receivers_of[room].size();
    const size_t rays = of_nodes ? size_t(most_node_rays) : size_t(options.samples);
    s.rows.begin_block();
    for (size_t i = begin; i < begin + gather_block; ++i) {
      s.rows.begin_row();
      std::fill(s.sky.begin(), s.sky.end(), 0.0f);
      size_t backs = 0;
      if (i < all && of_nodes) {
        const std::span<const NodeRay> own = space.rays_of(space.nodes_of[room][i]);
        // As if all nodes had as many rays.
        for (size_t j = 0; j < rays && !own.empty(); ++j) {
          const NodeRay& ray = own[j % own.size()];
          add_ray(room, geometry, ray.origin, ray.direction, geometry.tracer.closest(ray.origin, ray.direction), s,
                  backs);
        }
      } else if (i < all) {
        const uint32_t r = receivers_of[room][i];
        const DirectionChoice c = choose_directions(sets, receivers.normals[r], options.seed, r);
        const size_t base = size_t(c.set) * sets.stride;
        rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                          s.x.data(), s.y.data(), s.z.data());
        geometry.tracer.closest_fan(receivers.origins[r], {s.x.data(), s.y.data(), s.z.data(), rays}, s.hits.data());
        for (size_t j = 0; j < rays; ++j)
          add_ray(room, geometry, receivers.origins[r], {s.x[j], s.y[j], s.z[j]}, s.hits[j], s, backs);
        if (first) buried[r] = 2 * backs > rays;
      }
      s.rows.end_row();
      if (first) {
        float* row = e.data() + (first_row[room] + b * gather_block + i - begin) * coefficients;
        for (size_t k = 0; k < coefficients; ++k) row[k] = s.sky[k] / float(rays);
      }
    }
    s.rows.finish(channels, of_nodes ? 1.0f : weight_unit, out);
    return rays;
  }

  Pool<RowScratch> scratch{[this] {
    return std::unique_ptr<RowScratch>(
        new RowScratch{BlockBuilder(rows), AlignedVector<float>(sets.stride), AlignedVector<float>(sets.stride),
                       AlignedVector<float>(sets.stride), std::vector<Hit>(size_t(options.samples)),
                       std::vector<float>(coefficients), std::vector<float>(coefficients)});
  }};

  Result<void> trace() {
    const auto start = Clock::now();
    e.assign(rows * coefficients, 0.0f), buried.assign(n(), 0);
    const size_t fixed = rows * (4 * coefficients + 4 * width) + n() * 4 * width + space.bytes();
    if (options.memory < fixed)
      return Error{scene.path, "baking needs at least " + std::to_string(fixed) +
                                   " bytes of working memory, and was allowed " + std::to_string(options.memory)};
    kept = std::make_unique<KeptRows>(rows / gather_block, options.memory - fixed,
                                      most_bytes(size_t(options.samples), rows, channels), how.scratch);
    ProgressStage stage(progress, "tracing rooms", rows);
    for (size_t room = 0; room < room_count(); ++room) {
      auto geometry = space.geometry(room, scene);
      if (!geometry) return geometry.error();
      parallel_for(rooms_end(room) - first_row[room], gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        SparseBlock block;
        PackedBlock packed;
        trace_block(room, *geometry, begin / gather_block, true, *scratch.borrow(), block);
        pack(block, packed.rows);
        kept->keep(first_row[room] / gather_block + begin / gather_block, packed);
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    fill = make_fill_steps(scene, receivers.basis, buried);
    report.trace_seconds = seconds_since(start);
    report.working_memory = fixed + kept->bytes();
    report.operator_bytes = kept->bytes(), report.operator_file_bytes = kept->file_bytes();
    report.operator_kept = kept->fraction();
    return {};
  }

  void expand(const float* from, float* to) const {
    for (size_t k = 0; k < coefficients; ++k)
      for (size_t c = 0; c < size_t(channels); ++c) to[k * size_t(channels) + c] = from[k];
    std::fill(to + coefficients * size_t(channels), to + width, 0.0f);
  }

  // Receivers inside something have what their neighbours have.
  void fill_rows() {
    for (const FillStep& step : fill) {
      float* out = x.data() + size_t(row_of[step.receiver]) * width;
      std::fill(out, out + width, 0.0f);
      for (uint32_t s : step.sources)
        for (size_t k = 0; k < width; ++k) out[k] += x[size_t(row_of[s]) * width + k] / float(step.sources.size());
    }
  }

  // Whether row i of a room is of a receiver inside something, whose equation is another.
  bool is_filled(size_t room, size_t i) const { return i < receivers_of[room].size() && buried[receivers_of[room][i]]; }

  struct Change {
    double change = 0, all = 0;
  };

  // All rows of a room once, from what x was before.
  Result<Change> iterate(size_t room, AlignedVector<float>& fresh, std::optional<RoomGeometry>& geometry) {
    const size_t first = first_row[room], count = rooms_end(room) - first;
    fresh.resize(count * width);
    std::vector<Change> changes(count / gather_block);
    if (kept->fraction() < 1 && !geometry) {
      auto made = space.geometry(room, scene);
      if (!made) return made.error();
      geometry = std::move(*made);
    }
    parallel_for(count, gather_block, [&](size_t begin, size_t end) {
      if (is_cancelled(progress)) return;
      const size_t b = begin / gather_block;
      SparseBlock block;
      std::vector<uint8_t> buffer;
      KeptRows::Block packed;
      const size_t rays = b < receiver_blocks(room) ? size_t(options.samples) : size_t(most_node_rays);
      if (!kept->find(first / gather_block + b, buffer, packed) || !unpack(packed.rows, rows, channels, block)) {
        trace_block(room, *geometry, b, false, *scratch.borrow(), block);
        traced_anew = true;
      }
      AlignedVector<float> sums(gather_block * width, 0.0f);
      multiply_entries(block.view().entries, channels, x.data(), width, sums.data());
      const float scale = 1.0f / ((b < receiver_blocks(room) ? weight_unit : 1.0f) * float(rays));
      Change& c = changes[b];
      for (size_t i = begin; i < end; ++i) {
        float* y = fresh.data() + i * width;
        const float* old = x.data() + (first + i) * width;
        expand(e.data() + (first + i) * coefficients, y);
        for (size_t k = 0; k < width; ++k) y[k] += scale * sums[(i - begin) * width + k];
        if (is_filled(room, i)) continue;
        for (size_t k = 0; k < width; ++k)
          c.change += double(y[k] - old[k]) * double(y[k] - old[k]), c.all += double(y[k]) * double(y[k]);
      }
    });
    if (is_cancelled(progress)) return Error{"", "cancelled"};
    Change sum;
    for (const Change& c : changes) sum.change += c.change, sum.all += c.all;
    return sum;
  }

  // The rows of receivers inside something are not gathered but filled.
  void store(size_t room, const AlignedVector<float>& fresh) {
    const size_t first = first_row[room], count = rooms_end(room) - first;
    parallel_for(count, gather_block, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (is_filled(room, i)) continue;
        std::copy_n(fresh.data() + i * width, width, x.data() + (first + i) * width);
      }
    });
  }

  Result<void> solve() {
    const auto start = Clock::now();
    x.assign(rows * width, 0.0f);
    for (size_t r = 0; r < rows; ++r) expand(e.data() + r * coefficients, x.data() + r * width);
    fill_rows();
    AlignedVector<float> fresh;
    for (int sweep = 0; sweep < how.most_sweeps && !told.converged; ++sweep) {
      ProgressStage stage(progress, "joining rooms, sweep " + std::to_string(sweep + 1), room_count());
      Change met;  // as each room was met, with the newest light of its openings
      for (size_t room = 0; room < room_count(); ++room, stage.advance()) {
        std::optional<RoomGeometry> geometry;
        for (int inner = 0; inner < inner_most; ++inner) {
          auto change = iterate(room, fresh, geometry);
          if (!change) return change.error();
          if (inner == 0) met.change += change->change, met.all += change->all;
          store(room, fresh), fill_rows();
          if (change->change <= 0.1 * how.residual * how.residual * change->all) break;
        }
      }
      told.residuals.push_back(met.all > 0 ? std::sqrt(met.change / met.all) : 0.0);
      told.converged = told.residuals.back() <= how.residual;
    }
    report.bounce_seconds = seconds_since(start);
    return {};
  }

  Result<Transfer> bake() {
    assign_receivers();
    if (auto ok = find_nodes(); !ok) return ok.error();
    number_rows();
    if (auto ok = trace(); !ok) return ok.error();
    if (auto ok = solve(); !ok) return ok.error();
    kept.reset(), e = {};
    AlignedVector<float> all(n() * width);
    for (size_t r = 0; r < n(); ++r) std::copy_n(x.data() + size_t(row_of[r]) * width, width, all.data() + r * width);
    x = {};
    for (uint8_t b : buried) report.buried += b;
    told.lost = crossed > 0 ? double(lost) / double(crossed) : 0.0;
    report.receivers = n(), report.samples = options.samples;
    report.rays = n() * size_t(options.samples) + told.nodes * size_t(most_node_rays);
    Transfer out = store_columns(options.light(), all.data(), 1, channels, n(), width, options.precision);
    report.bytes = out.bytes();
    return out;
  }
};

}  // namespace

Result<Transfer> bake_rooms(const Scene& scene, const Receivers& receivers, const std::vector<Room>& rooms,
                            const BakeOptions& options, const RoomsOptions& how, BakeReport* report,
                            RoomsReport* rooms_report, Progress* progress) {
  if (auto ok = check_light_basis(options, 1); !ok) return ok.error();
  if (!options.lobes.empty()) return Error{"lobes", "are not joined between rooms"};
  if (options.samples < 1 || options.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(options.samples)};
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  if (!std::holds_alternative<CornerReceivers>(receivers.basis))
    return Error{"rooms", "join receivers at vertices alone"};
  const std::vector<uint8_t> passing = see_through_materials(scene);
  for (const Part& part : scene.parts)
    if (!passing.empty() && passing[part.material])
      return Error{"--rooms", "does not know surfaces that let light pass: \"" + part.name + "\" is one", true};
  BakeReport unwanted;
  RoomsReport untold;
  BakeReport& r = report ? *report : unwanted;
  RoomsReport& t = rooms_report ? *rooms_report : untold;
  r = {}, t = {};
  const std::unique_ptr<RoomBaker> baker(new RoomBaker{
      scene, receivers, options, how, RoomSpace(scene, rooms, how.places, how.directions), r, t, progress});
  return baker->bake();
}

}  // namespace lambent
