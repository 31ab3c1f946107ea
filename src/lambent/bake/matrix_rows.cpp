// Follows: general-prt (the recursion over bounces with glossy scattering at the hits).
#include <lambent/bake/matrix_rows.h>
#include <lambent/core/parallel.h>

#include <set>

namespace lambent {

MatrixRows::MatrixRows(MatrixGather& gather, size_t budget)
    : gather_(gather),
      budget_(budget),
      T0_(gather.n() * gather.t0_width()),
      T0_half_(checked_count(gather.n()) * gather.t0_width()),
      buried_(gather.n()),
      is_kept_((gather.n() + gather_block - 1) / gather_block),
      kept_(is_kept_.size()) {}

void MatrixRows::trace_receiver(MatrixScratch& s, size_t r, MatrixHits& hits) {
  buried_[r] = gather_.trace(s, r, &hits);
  float* full = T0_.data() + r * gather_.t0_width();
  float* half = r % check_every ? nullptr : T0_half_.data() + r / check_every * gather_.t0_width();
  gather_.direct_light(s, r, full, half);
  hits.ends.push_back(uint32_t(hits.hits.size()));
}

// Which blocks are kept depends on the scheduling, the result does not: the others are traced again, alike.
void MatrixRows::trace_block(size_t block, const KeptPieces* pieces) {
  const size_t first = block * gather_block, end = std::min(rows(), first + gather_block), width = gather_.t0_width();
  const std::span<float> T0(T0_.data() + first * width, (end - first) * width),
      half(T0_half_.data() + checked_count(first) * width, (checked_count(end) - checked_count(first)) * width);
  const std::span<uint8_t> buried(buried_.data() + first, end - first);
  MatrixHits hits;
  bool loaded = pieces && pieces->load(block, T0, half, buried, hits.hits, hits.weights, hits.ends);
  if (loaded && !is_sound(hits, end - first)) pieces->refuse(), loaded = false, hits = {};
  auto s = gather_.scratch.borrow();
  for (size_t r = first; r < end && !loaded; ++r) {
    if (is_cancelled(gather_.setup.progress)) return;
    trace_receiver(*s, r, hits);
  }
  note_asked(hits);
  if (pieces && !loaded) pieces->save(block, T0, half, buried, hits.hits, hits.weights, hits.ends);
  const size_t bytes = hits.bytes();
  if (is_kept_[block]) used_ += bytes, used_ -= kept_[block].bytes(), kept_[block] = std::move(hits);
  else if (used_.fetch_add(bytes) + bytes <= budget_) kept_[block] = std::move(hits), is_kept_[block] = 1;
  else used_ -= bytes;
}

// Of hits that were kept: whether they are such as this tracing makes.
bool MatrixRows::is_sound(const MatrixHits& hits, size_t receivers) const {
  if (hits.ends.size() != receivers || !std::is_sorted(hits.ends.begin(), hits.ends.end()) ||
      hits.ends.back() != hits.hits.size() || (!hits.weights.empty() && hits.weights.size() != hits.hits.size()))
    return false;
  return std::all_of(hits.hits.begin(), hits.hits.end(), [&](const MatrixHit& h) {
    return h.ray < gather_.rays() && h.corner / 2 < gather_.scene.triangles.size() &&
           gather_.corners().find(h.corner / 2, h.corner % 2);
  });
}

// Whose scattered rows hits look up.
void MatrixRows::note_asked(const MatrixHits& hits) {
  if (asks_.empty()) return;
  for (const MatrixHit& h : hits.hits)
    for (uint32_t receiver : gather_.corners().find(h.corner / 2, h.corner % 2)->receiver)
      std::atomic_ref(asks_[receiver]).store(1, std::memory_order_relaxed);
}

void MatrixRows::fetch(float* x, size_t) const {
  ++shares_.ranks().asks;
  asked_.fetch(x, [&](size_t row) {
    const size_t first = gather_.first_row[row], wc = gather_.wc();
    return std::pair(first * wc, (gather_.first_row[row + 1] - first) * wc);
  });
}

Result<void> MatrixRows::trace(Progress* progress) {
  shares_ = Shares(rows(), gather_block);
  asks_.assign(shares_.alone() ? 0 : rows(), 0);
  ProgressStage stage(progress, "tracing", shares_.own());
  const KeptPieces pieces(progress, "tracing", kept_.size());
  shares_.for_own([&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    trace_block(begin / gather_block, &pieces);
    stage.advance(end - begin);
  });
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares_.gather(buried_.data());
  move_buried(progress);
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares_.gather(buried_.data());
  if (!asks_.empty()) asked_ = AskedRows(shares_, asks_);
  return {};
}

// A buried receiver looks out from where its nearest clear neighbour along the mesh lies.
void MatrixRows::move_buried(Progress* progress) {
  std::set<size_t> touched;
  for (const FillStep& step : make_fill_steps(gather_.scene, gather_.receivers.basis, buried_)) {
    gather_.receivers.origins[step.receiver] = gather_.receivers.origins[step.sources[0]];
    if (shares_.owner(step.receiver) == shares_.ranks().rank()) touched.insert(step.receiver / gather_block);
  }
  const std::vector<size_t> blocks(touched.begin(), touched.end());
  if (blocks.empty()) return;
  ProgressStage stage(progress, "moving buried", blocks.size());
  parallel_for(blocks.size(), 1, [&](size_t begin, size_t) {
    if (stage.cancelled()) return;
    trace_block(blocks[begin], nullptr);
    stage.advance();
  });
}

double MatrixRows::kept() const {
  const auto own = std::count(is_kept_.begin(), is_kept_.end(), uint8_t(1));
  return double(shares_.ranks().sum(uint64_t(own))) / double(is_kept_.size());
}

void MatrixRows::add_rows(size_t r, size_t, const float* Y, size_t, float* y, float* half) const {
  const size_t b = r / gather_block, i = r % gather_block;
  auto s = gather_.scratch.borrow();
  MatrixHits again;
  std::span<const MatrixHit> mine;
  const Vec3* through = nullptr;
  if (is_kept_[b]) {
    const MatrixHits& hits = kept_[b];
    const size_t first = i == 0 ? 0 : hits.ends[i - 1];
    mine = {hits.hits.data() + first, hits.ends[i] - first};
    if (!hits.weights.empty()) through = hits.weights.data() + first;
    (void)gather_.aim(*s, r);
  } else {
    (void)gather_.trace(*s, r, &again);
    mine = again.hits, again_ += gather_.rays();
    if (!again.weights.empty()) through = again.weights.data();
  }
  gather_.scattered(*s, mine, through, gather_.rays(), Y, y);
  if (half) gather_.scattered(*s, mine, through, gather_.setup.sets.half, Y, half);
}

void MatrixRows::keep(size_t first, size_t count, const float* y, size_t width, float* x) const {
  const size_t J = gather_.J(), wc = gather_.wc();
  for (size_t r = first; r < first + count; ++r, y += width) {
    const FactoredResponse& f = gather_.scatter[gather_.materials.of_receiver[r]];
    float* out = x + gather_.first_row[r] * wc;
    std::fill_n(out, size_t(f.rows) * wc, 0.0f);
    for (size_t row = 0; row < size_t(f.rows); ++row)
      for (size_t j = 0; j < J; ++j) {
        const float h = f.h[row * J + j];
        if (h == 0) continue;
        for (size_t k = 0; k < wc; ++k) out[row * wc + k] += h * y[j * wc + k];
      }
  }
}

}  // namespace lambent
