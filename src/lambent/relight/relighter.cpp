#include <lambent/basis/sh.h>
#include <lambent/relight/block_runs.h>
#include <lambent/relight/factors.h>
#include <lambent/relight/relighter.h>

#include <bit>
#include <numeric>
#include <variant>

namespace lambent {
namespace {

Error wrong(std::string message) { return {"relighter", std::move(message)}; }

// Light as columns, and a frame that no store but lobes can use.
struct Columns {
  std::vector<Vec3> light;
  bool ready = false;
  void set(std::span<const Vec3> columns) { light.assign(columns.begin(), columns.end()), ready = true; }
};
Result<void> at_rest(const RelightFrame& frame) {
  if (frame.frames) return wrong("this transfer cannot turn with the surface; that of lobes can");
  if (frame.light) return wrong("this transfer takes one light for all receivers; that of lobes takes one for each");
  return {};
}

Result<void> check_seen(const RelightFrame& frame, size_t receivers) {
  for (uint32_t r : frame.seen.value_or(std::span<const uint32_t>()))
    if (r >= receivers) return wrong("receiver " + std::to_string(r) + " is out of range");
  return {};
}
// Calls run(the runs of blocks that are seen), or run(null) where all are.
template <class Run>
Result<void> of_seen(const RelightFrame& frame, size_t receivers, Relit& out, const Run& run) {
  if (!frame.seen) return run(nullptr), Result<void>();
  if (auto ok = check_seen(frame, receivers); !ok) return ok;
  const BlockRuns runs = block_runs(*frame.seen, receivers);
  if (!frame.keep) std::fill(out.values.begin(), out.values.end(), 0.0f);
  return run(&runs), Result<void>();
}

// Dense or in clusters.
template <class Store>
struct OfColumns : Columns {
  const Store& store;
  explicit OfColumns(const Store& s) : store(s) {}
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (auto ok = at_rest(frame); !ok) return ok;
    return of_seen(frame, store.receivers, out,
                   [&](const BlockRuns* runs) { lambent::relight(store, light, out, runs); });
  }
  // Dense transfer needs nothing between.
  Result<void> relight(const RelightFrame& frame, std::span<float> out,
                       size_t stride) requires(std::is_same_v<Store, Transfer>) {
    if (auto ok = at_rest(frame); !ok) return ok;
    lambent::relight(store, light, out, stride);
    return {};
  }
};

struct OfLobes : Columns {
  const ZonalTransfer& store;
  bool direct;
  ZonalLight table;
  OfLobes(const ZonalTransfer& s, bool directly) : store(s), direct(directly) {}
  void set(std::span<const Vec3> columns) {
    Columns::set(columns);
    if (!direct) specialise_light(store, columns, table);
  }
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (frame.frames && frame.frames->receivers != store.receivers)
      return wrong("has frames for " + std::to_string(frame.frames->receivers) + " of " +
                   std::to_string(store.receivers) + " receivers");
    if (frame.light && (frame.light->receivers != store.receivers || frame.light->order < store.order))
      return wrong("the light field has other receivers, or fewer bands than the lobes");
    if (frame.light) relight_zonal(store, frame.frames, *frame.light, out);
    else if (direct) relight_zonal(store, frame.frames, light, out);
    else
      return of_seen(frame, store.receivers, out,
                     [&](const BlockRuns* runs) { relight_zonal(store, frame.frames, table, out, runs); });
    return {};
  }
};

struct OfFactors : Columns {
  const FactoredTransfer& store;
  const Outgoing& outgoing;
  FactorLight product;
  OfFactors(const FactoredTransfer& s, const Outgoing& o) : store(s), outgoing(o) {}
  void set(std::span<const Vec3> columns) {
    ready = true;
    lambent::set_light(product, store.light_order(), store.incident_order, columns);
  }
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (auto ok = at_rest(frame); !ok) return ok;
    relight_factors(store.visibility, outgoing, product, out);
    return {};
  }
};

struct OfSurfels : Columns {
  const IndirectTransfer& store;
  DirectionalKind kind;
  IndirectSolve solve;
  OfSurfels(const IndirectTransfer& s, DirectionalKind directional, std::span<const Vec3> albedos)
      : store(s), kind(directional), solve(make_indirect_solve(s, albedos)) {}
  void set(std::span<const Vec3> columns) {
    ready = true, solve_indirect(store, solve, columns);
    if (kind != DirectionalKind::none) send_indirect(store, solve, columns);
  }
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (auto ok = at_rest(frame); !ok) return ok;
    if (kind == DirectionalKind::none) read_indirect(store, solve, out);
    else read_directional_indirect(store, solve, kind, out);
    return {};
  }
};

Result<void> check_cube(const CubeLight& cube, int size) {
  if (cube.size == size) return {};
  return wrong("the light is on a cube of " + std::to_string(cube.size) + " texels a side, the transfer on one of " +
               std::to_string(size));
}

struct OfWavelets {
  const HaarTransfer& store;
  size_t count;
  std::vector<float> norms;
  bool ready = false;
  HaarTerms terms = {};
  OfWavelets(const HaarTransfer& s, size_t n) : store(s), count(n), norms(haar_column_norms(s)) {}
  Result<void> set(const CubeLight& cube) {
    if (auto ok = check_cube(cube, store.size); !ok) return ok;
    ready = true, terms = haar_terms(store, norms, cube, count);
    return {};
  }
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (auto ok = at_rest(frame); !ok) return ok;
    lambent::relight(store, terms, out, frame.reading);
    return {};
  }
};

struct OfBlocks {
  const Visibility& store;
  RelighterOptions options;
  bool ready = false;
  BlockLight light = {};
  std::optional<HaarLight> haar = std::nullopt;
  ProductScratch scratch = {};
  std::vector<uint32_t> all = {};
  Result<void> set(const CubeLight& cube) {
    if (auto ok = check_cube(cube, store.size); !ok) return ok;
    ready = true;
    lambent::set_light(light, cube);
    if (options.product == Product::haar) haar = make_haar_light(cube, options.haar_fraction);
    return {};
  }
  Result<void> relight(const RelightFrame& frame, Relit& out) {
    if (auto ok = at_rest(frame); !ok) return ok;
    if (const int n = frame.most_samples; n != 1 && n != 4 && n != 16 && n != 64 && n != 256)
      return wrong("a block has 1, 4, 16, 64 or 256 samples at most, not " + std::to_string(n));
    if (!frame.seen && all.empty()) all.resize(store.receivers), std::iota(all.begin(), all.end(), 0u);
    const std::span<const uint32_t> seen = frame.seen ? *frame.seen : all;
    if (auto ok = check_seen(frame, store.receivers); !ok) return ok;
    shade_receivers(options.product, light, haar ? &*haar : nullptr, store, options.receivers, seen, frame.eye, out,
                    frame.breakdown, &scratch, frame.keep, frame.most_samples);
    return {};
  }
};

Result<void> check_products(const Visibility& v, const RelighterOptions& o) {
  const ProductReceivers& r = o.receivers;
  if (r.positions.size() != v.receivers || r.frames.size() != v.receivers || r.material_of.size() != v.receivers)
    return wrong("visibility in blocks wants a position, a frame and a material for each receiver");
  for (uint32_t m : r.material_of)
    if (m >= r.materials.size()) return wrong("material " + std::to_string(m) + " does not exist");
  if (o.product == Product::haar && !std::has_single_bit(unsigned(v.size)))
    return wrong("Haar wavelets want a cube of 2^k texels a side");
  if (!(o.haar_fraction > 0 && o.haar_fraction <= 1)) return wrong("the share of Haar coefficients is out of range");
  return {};
}

using AnyStore =
    std::variant<OfColumns<Transfer>, OfColumns<CpcaTransfer>, OfLobes, OfFactors, OfBlocks, OfSurfels, OfWavelets>;

struct Make {
  const Field& field;
  RelighterOptions& options;
  AnyStore operator()(const Transfer& t) const { return OfColumns<Transfer>(t); }
  AnyStore operator()(const CpcaTransfer& t) const { return OfColumns<CpcaTransfer>(t); }
  AnyStore operator()(const ZonalTransfer& t) const { return OfLobes(t, options.direct_lobes); }
  AnyStore operator()(const FactoredTransfer& t) const { return OfFactors(t, *outgoing_of(field)); }
  AnyStore operator()(const IndirectTransfer& t) const { return OfSurfels(t, directional_of(field), options.albedos); }
  AnyStore operator()(const HaarTransfer& t) const { return OfWavelets(t, options.terms); }
  AnyStore operator()(const Visibility& v) const { return OfBlocks{v, std::move(options)}; }
};

}  // namespace

struct Relighter::State {
  const Field& field;
  AnyStore store;
  Relit between = {};
};

Relighter::Relighter(std::unique_ptr<State> state) : state_(std::move(state)) {}
Relighter::Relighter(Relighter&&) noexcept = default;
Relighter& Relighter::operator=(Relighter&&) noexcept = default;
Relighter::~Relighter() = default;

Result<Relighter> Relighter::make(const Field& field, RelighterOptions options) {
  if (!is_consistent(field)) return wrong("placement, store and rows of the field do not fit one another");
  if (const auto* v = std::get_if<Visibility>(&field.store))
    if (auto ok = check_products(*v, options); !ok) return ok.error();
  if (const auto* t = std::get_if<HaarTransfer>(&field.store);
      t && !(is_cube_size(t->size) && std::has_single_bit(unsigned(t->size))))
    return wrong("wavelets want a cube of 16, 32, 64, 128 or 256 texels a side");
  if (const auto* t = std::get_if<IndirectTransfer>(&field.store)) {
    if (auto ok = check_indirect(*t, "relighter"); !ok) return ok.error();
    if (!options.albedos.empty() && options.albedos.size() != t->surfels.count())
      return wrong("there is not an albedo for each surfel");
    if (directional_of(field) == DirectionalKind::hl2)
      return wrong("directional light of direct-to-indirect transport is sh:2, sh:3 or vector");
  }
  return Relighter(std::make_unique<State>(State{field, std::visit(Make{field, options}, field.store)}));
}

const Field& Relighter::field() const { return state_->field; }
LightBasis Relighter::light() const { return light_of(state_->field.store); }
size_t Relighter::receivers() const { return receivers_of(state_->field.store); }
int Relighter::rows() const { return rows_relit(state_->field.store); }

Result<void> Relighter::set_light(std::span<const Vec3> columns) {
  const auto* surfels = std::get_if<IndirectTransfer>(&state_->field.store);
  const size_t count = surfels ? surfels->surfels.count() : light().count();
  return std::visit(
      [&](auto& s) -> Result<void> {
        if constexpr (std::is_base_of_v<Columns, std::remove_reference_t<decltype(s)>>) {
          if (columns.size() != count)
            return wrong("the light has " + std::to_string(columns.size()) + " coefficients where the transfer has " +
                         std::to_string(count) + " columns");
          s.set(columns);
          return {};
        } else {
          return wrong("this transfer takes light on a cube");
        }
      },
      state_->store);
}

Result<void> Relighter::set_light(const CubeLight& light) {
  if (auto* blocks = std::get_if<OfBlocks>(&state_->store)) return blocks->set(light);
  if (auto* wavelets = std::get_if<OfWavelets>(&state_->store)) return wavelets->set(light);
  return wrong("this transfer takes a coefficient a column; blocks and wavelets take light on a cube");
}

Result<void> Relighter::relight(const RelightFrame& frame, Relit& out) {
  return std::visit(
      [&](auto& s) -> Result<void> {
        if (!s.ready && !frame.light) return wrong("no light was set");
        return s.relight(frame, out);
      },
      state_->store);
}

Result<void> Relighter::relight(const RelightFrame& frame, std::span<float> out, size_t stride) {
  const size_t each = 3 * size_t(rows()), n = receivers();
  if (stride < each) return wrong("a receiver has " + std::to_string(each) + " numbers, more than the stride");
  if (n > 0 && (n - 1 > (SIZE_MAX - each) / stride || out.size() < (n - 1) * stride + each))
    return wrong("there is no room for " + std::to_string(n) + " receivers");
  return std::visit(
      [&](auto& s) -> Result<void> {
        if (!s.ready && !frame.light) return wrong("no light was set");
        if constexpr (requires { s.relight(frame, out, stride); })
          if (!frame.seen) return s.relight(frame, out, stride);
        auto done = s.relight(frame, state_->between);
        if (done) interleave(state_->between, n, out, stride);
        return done;
      },
      state_->store);
}

}  // namespace lambent
