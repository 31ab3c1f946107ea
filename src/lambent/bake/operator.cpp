// Follows: radiosity, "Computing the Product", "Important Point" (the matrix is never formed densely).
#include <lambent/bake/operator.h>
#include <lambent/core/check.h>
#include <lambent/core/clock.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>

namespace lambent {

namespace {

// One piece of tracing as it is kept: what goes into the rows of all receivers, and the block's hit rows where there
// was room for them.
class TracedPiece {
 public:
  TracedPiece(const GatherWanted& wanted, const GatherSky& sky, const GatherDirect* direct, size_t begin, size_t end)
      : sky_(sky.rows, wanted.sky.rows ? (end - begin) * sky.stride : 0),
        half_(sky.half_rows, sky.half_rows ? (checked_count(end) - checked_count(begin)) * sky.stride : 0),
        buried_(sky.buried, end - begin),
        direct_(direct) {
    if (direct) lights_.resize((end - begin) * 3 * direct->lamps.groups());
  }

  bool load(const KeptPieces& pieces, size_t number, PackedBlock& packed, bool& has_rows) {
    const std::span<float> lights(lights_);
    if (!pieces.load(number, sky_, half_, buried_, lights, has_rows, packed.rows, packed.half_rows)) return false;
    for (size_t i = 0, each = direct_ ? 3 * direct_->lamps.groups() : 0; i * each < lights_.size(); ++i)
      std::copy_n(lights_.data() + i * each, each, direct_->rows + i * direct_->width);
    return true;
  }
  void save(const KeptPieces& pieces, size_t number, PackedBlock& packed, bool has_rows) {
    PackedBlock none;
    PackedBlock& rows = has_rows ? packed : none;
    for (size_t i = 0, each = direct_ ? 3 * direct_->lamps.groups() : 0; i * each < lights_.size(); ++i)
      std::copy_n(direct_->rows + i * direct_->width, each, lights_.data() + i * each);
    const std::span<float> lights(lights_);
    pieces.save(number, sky_, half_, buried_, lights, has_rows, rows.rows, rows.half_rows);
  }

 private:
  std::span<float> sky_, half_;
  std::span<uint8_t> buried_;
  const GatherDirect* direct_;
  std::vector<float> lights_;
};

// Rows that a block's hits met.
void note_asked(const GatherBlock& block, std::vector<uint8_t>& asked) {
  if (asked.empty()) return;
  for (const SparseBlock* rows : {&block.rows, &block.half_rows})
    for (uint32_t column : rows->columns) std::atomic_ref(asked[column]).store(1, std::memory_order_relaxed);
}

// Rows that own ones are filled from, and which are not filled themselves. Of the steps those that it takes are left.
std::vector<uint8_t> sources_of(const Shares& shares, std::vector<FillStep>& steps, size_t rows) {
  std::vector<uint8_t> wanted(rows);
  for (size_t i = steps.size(); i-- > 0;) {  // later ones are filled from earlier ones
    const uint32_t r = steps[i].receiver;
    if (wanted[r] || shares.owner(r) == shares.ranks().rank())
      for (uint32_t source : steps[i].sources) wanted[source] = 1;
    else steps[i].sources.clear();
    wanted[r] = 0;
  }
  std::erase_if(steps, [](const FillStep& step) { return step.sources.empty(); });
  return wanted;
}

}  // namespace

void GatherOperator::fill(float* x, size_t stride, size_t width) const {
  fill_means(x, stride, width);
  if (setup_->projection) solve_mass(setup_->projection->mass, x, stride, width);
}

void GatherOperator::fill_means(float* x, size_t stride, size_t width) const {
  sources_.fetch(x, [&](size_t row) { return std::pair(row * stride, width); });
  fill_buried(fill_, x, stride, width);
}

void GatherOperator::trace_block(const GatherWanted& wanted, size_t begin, size_t end, const KeptPieces& pieces,
                                 std::vector<uint8_t>& asked) {
  auto block = traced_->blocks.borrow();
  auto scratch = traced_->scratch.borrow();
  std::vector<float> unwanted(wanted.sky.rows ? 0 : (end - begin) * setup_->sky_width());
  GatherSky sky = wanted.sky;
  if (sky.rows) sky.rows += begin * sky.stride;
  else sky = {unwanted.data(), nullptr, setup_->sky_width(), nullptr, nullptr};
  if (sky.half_rows) sky.half_rows += checked_count(begin) * sky.stride;
  sky.buried = buried_.data() + begin;
  std::optional<GatherDirect> direct;
  if (const GatherDirect* d = wanted.direct)
    direct.emplace(GatherDirect{d->lamps, d->samples, d->rows + begin * d->width, d->width});
  const size_t number = begin / gather_block;
  TracedPiece piece(wanted, sky, direct ? &*direct : nullptr, begin, end);
  const auto packed = traced_->packed.borrow();
  bool has_rows = false;
  if (pieces && piece.load(pieces, number, *packed, has_rows)) {
    if (!has_rows || (unpack(packed->rows, rows(), setup_->channels, block->rows) &&
                      (!wanted.halves || unpack(packed->half_rows, rows(), setup_->channels, block->half_rows)))) {
      if (wanted.hits && has_rows) traced_->kept.keep(number, *packed);
      if (!wanted.halves) block->half_rows = {};
      if (has_rows) note_asked(*block, asked);
      else if (!asked.empty())
        for (uint8_t& a : asked) std::atomic_ref(a).store(1, std::memory_order_relaxed);
      return;
    }
    pieces.refuse();
  }
  trace_gather(*setup_, *scratch, begin, end - begin, wanted.hits ? block.get() : nullptr, &sky,
               direct ? &*direct : nullptr);
  if (wanted.more) wanted.more(begin, end - begin, sky);
  if (!wanted.halves) block->half_rows = {};
  if (wanted.hits) note_asked(*block, asked);
  if (wanted.hits) {
    pack(block->rows, packed->rows);
    packed->half_rows.clear();
    if (wanted.halves) pack(block->half_rows, packed->half_rows);
    has_rows = traced_->kept.keep(number, *packed);
  }
  if (pieces) piece.save(pieces, number, *packed, has_rows);
}

Result<GatherOperator> GatherOperator::trace(const GatherSetup& setup, const GatherWanted& wanted, Progress* progress) {
  const auto start = Clock::now();
  GatherOperator op;
  op.setup_ = &setup;
  const size_t n = setup.receivers.count();
  op.buried_.assign(n, 0);
  const Shares& shares = op.shares_ = Shares(n, gather_block);
  std::vector<uint8_t> asked(wanted.hits && !shares.alone() ? n : 0);
  op.traced_ = std::shared_ptr<Traced>(new Traced{
      KeptRows(op.blocks(), wanted.hits ? wanted.memory : 0, most_bytes(size_t(setup.sets.samples), n, setup.channels),
               wanted.hits && progress ? progress->scratch : std::string()),
      Pool<GatherBlock>([] { return std::make_unique<GatherBlock>(); }),
      Pool<PackedBlock>([] { return std::make_unique<PackedBlock>(); }),
      Pool<GatherScratch, DeleteScratch>([&setup] { return make_gather_scratch(setup); }),
      Pool<AlignedVector<float>>([] { return std::make_unique<AlignedVector<float>>(); })});
  ProgressStage stage(progress, "tracing", shares.own());
  const KeptPieces pieces(progress, "tracing", op.blocks());
  shares.for_own([&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    op.trace_block(wanted, begin, end, pieces, asked);
    stage.advance(end - begin);
  });
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares.gather(op.buried_.data());
  op.fill_ = make_fill_steps(setup.scene, setup.receivers.basis, op.buried_);
  if (!op.fill_.empty()) op.sources_ = AskedRows(shares, sources_of(shares, op.fill_, n));
  if (const GatherDirect* d = wanted.direct) op.fill_means(d->rows, d->width, 3 * d->lamps.groups());
  if (wanted.sky.rows) op.fill_means(wanted.sky.rows, wanted.sky.stride, wanted.sky.stride);
  if (!asked.empty()) op.asked_ = AskedRows(shares, asked);
  for (uint8_t b : op.buried_) op.report_.buried += b;
  op.report_.rays = n * size_t(setup.sets.samples), op.report_.bytes = shares.ranks().sum(op.traced_->kept.bytes());
  op.report_.file_bytes = shares.ranks().sum(op.traced_->kept.file_bytes());
  op.report_.kept = double(shares.ranks().sum(op.traced_->kept.count())) / double(op.blocks());
  op.report_.seconds = seconds_since(start);
  return op;
}

Result<GatherOperator> GatherOperator::trace(const GatherSetup& setup, const GatherDirect* direct, float* sky,
                                             bool hits, size_t memory, Progress* progress) {
  return trace(
      setup,
      {.direct = direct, .sky = {sky, nullptr, setup.sky_width(), nullptr, nullptr}, .hits = hits, .memory = memory},
      progress);
}

GatherOperator::Report GatherOperator::report() const {
  Report r = report_;
  r.rays += shares_.ranks().sum(traced_->rays);
  return r;
}

void GatherOperator::with_rows(size_t b, bool halves, auto f) const {
  const auto block = traced_->blocks.borrow();
  {
    const auto buffer = traced_->packed.borrow();
    KeptRows::Block kept;
    if (traced_->kept.find(b, buffer->rows, kept) && unpack(kept.rows, rows(), setup_->channels, block->rows) &&
        (!halves || unpack(kept.half_rows, rows(), setup_->channels, block->half_rows)))
      return f(*block);
  }
  const size_t begin = b * gather_block, count = std::min(gather_block, rows() - begin);
  trace_gather(*setup_, *traced_->scratch.borrow(), begin, count, block.get(), nullptr);
  traced_->rays += count * size_t(setup_->sets.samples);
  f(*block);
}

void GatherOperator::add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float* half) const {
  LAMBENT_CHECK(first % gather_block == 0 && count <= gather_block);
  const auto sums = traced_->sums.borrow();
  auto add = [&](const SparseBlock& rows, size_t rays, float* out) {
    const float scale = setup_->row_scale(rays);
    sums->assign(rows.row_count * width, 0.0f);
    multiply_entries(rows.view().entries, setup_->channels, x, width, sums->data());
    for (size_t i = 0; i < sums->size(); ++i) out[i] += scale * (*sums)[i];
  };
  with_rows(first / gather_block, half != nullptr, [&](const GatherBlock& block) {
    add(block.rows, size_t(setup_->sets.samples), y);
    if (half) add(block.half_rows, setup_->sets.half, half);
  });
}

std::optional<TransposedRows> GatherOperator::transposed() const {
  if (!shares_.alone() || setup_->projection) return std::nullopt;
  TransposedRows push;
  push.channels = setup_->channels;
  push.first.assign(rows() + 1, 0);
  const size_t channels = size_t(push.channels);
  auto each_entry = [&](auto f) {
    for (size_t b = 0; b < blocks(); ++b)
      with_rows(b, false, [&](const GatherBlock& block) {
        const SparseEntries s = block.rows.view().entries;
        for (size_t k = 0, e = 0; k < s.column_count; ++k)
          for (; e < s.ends[k]; ++e) {
            const size_t row = b * gather_block + s.rows[e];
            if (!buried_[row]) f(s.columns[k], uint32_t(row), s.weights + e * channels);
          }
      });
  };
  each_entry([&](uint32_t column, uint32_t, const uint16_t*) { ++push.first[column + 1]; });
  for (const FillStep& step : fill_)
    for (uint32_t s : step.sources) ++push.first[s + 1];
  for (size_t j = 0; j < rows(); ++j) push.first[j + 1] += push.first[j];
  push.row.resize(push.first.back()), push.weight.resize(push.first.back() * channels);
  std::vector<size_t> next(push.first.begin(), push.first.end() - 1);
  const float scale = setup_->row_scale(size_t(setup_->sets.samples));
  each_entry([&](uint32_t column, uint32_t row, const uint16_t* w) {
    const size_t at = next[column]++;
    push.row[at] = row;
    for (size_t c = 0; c < channels; ++c) push.weight[at * channels + c] = half_to_float(w[c]) * scale;
  });
  for (const FillStep& step : fill_)
    for (uint32_t s : step.sources) {
      const size_t at = next[s]++;
      push.row[at] = step.receiver;
      for (size_t c = 0; c < channels; ++c) push.weight[at * channels + c] = 1.0f / float(step.sources.size());
    }
  return push;
}

}  // namespace lambent
