#include <lambent/transfer/field.h>
#include <lambent/core/overloaded.h>

#include <algorithm>

namespace lambent {
namespace {

size_t most_receivers(const std::vector<uint32_t>& a, const std::vector<uint32_t>& b) {
  size_t most = 0;
  for (const auto* list : {&a, &b})
    for (uint32_t r : *list)
      if (r != no_receiver) most = std::max(most, size_t(r) + 1);
  return most;
}

}  // namespace

LightBasis light_of(const Store& store) {
  return std::visit(Overloaded{[](const Transfer& t) { return t.light; }, [](const CpcaTransfer& t) { return t.light; },
                               [](const ZonalTransfer& t) { return LightBasis{.order = t.order}; },
                               [](const FactoredTransfer& t) { return LightBasis{.order = t.light_order()}; },
                               [](const auto&) { return LightBasis{}; }},
                    store);
}

int cube_of(const Store& store) {
  return std::visit(Overloaded{[](const Visibility& v) { return v.size; }, [](const HaarTransfer& t) { return t.size; },
                               [](const auto&) { return 0; }},
                    store);
}

size_t receivers_of(const Store& store) {
  return std::visit(Overloaded{[](const FactoredTransfer& t) { return t.visibility.receivers; },
                               [](const auto& t) { return t.receivers; }},
                    store);
}

size_t bytes_of(const Store& store) {
  return std::visit(Overloaded{[](const FactoredTransfer& t) { return t.visibility.bytes(); },
                               [](const auto& t) { return t.bytes(); }},
                    store);
}

int rows_of(const Store& store) {
  return std::visit(Overloaded{[](const FactoredTransfer&) { return 1; }, [](const Visibility&) { return 0; },
                               [](const auto& t) { return t.rows; }},
                    store);
}

int rows_relit(const Store& store) {
  return std::visit(Overloaded{[](const FactoredTransfer& t) { return t.incident_order * t.incident_order; },
                               [](const Visibility&) { return 1; }, [](const auto& t) { return t.rows; }},
                    store);
}

int channels_of(const Store& store) {
  return std::visit(Overloaded{[](const FactoredTransfer&) { return 1; }, [](const Visibility&) { return 0; },
                               [](const auto& t) { return t.channels; }},
                    store);
}

const char* name_of(const Store& store) {
  static constexpr const char* names[] = {"dense", "clusters", "lobes", "factors", "blocks", "surfels", "wavelets"};
  static_assert(std::size(names) == std::variant_size_v<Store>);
  return names[store.index()];
}

DirectionalKind directional_of(const Field& field) {
  const auto* rows = std::get_if<DirectionalRows>(&field.rows);
  return rows ? rows->kind : DirectionalKind::none;
}

std::vector<std::array<uint32_t, 2>> input_receivers(const VertexPlacement& where) {
  std::vector<std::array<uint32_t, 2>> pairs;
  for (size_t v = 0; v < where.input.size(); ++v)
    if (where.input[v] != no_receiver && where.front[v] != no_receiver)
      pairs.push_back({where.input[v], where.front[v]});
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

Field lattice_field(LatticeTransfer l) {
  return {LatticePlacement{l.lattice, std::move(l.valid)}, std::move(l.transfer), IncidentRows{l.order}};
}

bool is_consistent(const Field& field) {
  const size_t n = receivers_of(field.store);
  const bool placed = std::visit(
      Overloaded{[&](const VertexPlacement& p) {
                   return most_receivers(p.front, p.back) <= n && most_receivers(p.input, {}) <= p.input_count &&
                          (p.input.empty() || p.input.size() == p.front.size());
                 },
                 [&](const TexelPlacement& p) {
                   return p.texels.size() == size_t(p.width) * size_t(p.height) && most_receivers(p.texels, {}) <= n;
                 },
                 [&](const PatchPlacement& p) { return most_receivers(p.front, p.back) <= n; },
                 [&](const LatticePlacement& p) { return p.lattice.count() == n && p.valid.size() == n; },
                 [&](const FixedView& p) { return size_t(p.width) * size_t(p.height) == n && p.coverage.size() == n; },
                 [&](const ShellPlacement& p) { return is_consistent(p.shells) && p.shells.count() == n; }},
      field.where);
  const int rows = rows_of(field.store);
  const auto* factored = std::get_if<FactoredTransfer>(&field.store);
  const bool meant = std::visit(
      Overloaded{[&](const DiffuseRows&) { return rows == 1 && !factored; },
                 [&](const DirectionalRows& r) { return rows == directional_rows(r.kind) && !factored; },
                 [&](const Outgoing& o) {
                   return factored ? o.kind == OutgoingKind::map && o.order == factored->incident_order &&
                                         factored->light_order() >= 1
                                   : rows == o.rows();
                 },
                 [&](const IncidentRows& r) { return rows == r.order * r.order && !factored; },
                 [&](const PixelRows&) { return rows == 1 && !factored; }, [&](const SightRows&) { return rows == 0; },
                 [&](const HiddenRows&) { return rows == 1 && !factored; }},
      field.rows);
  return placed && meant && (field.fit_errors.empty() || field.fit_errors.size() == n);
}

}  // namespace lambent
