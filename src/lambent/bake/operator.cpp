// Follows: radiosity, "Computing the Product", "Important Point" (the matrix is never formed densely).
#include <lambent/bake/operator.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>

#include <chrono>

namespace lambent {

Result<GatherOperator> GatherOperator::trace(const GatherSetup& setup, const GatherDirect* direct, float* sky_rows,
                                             bool hits, size_t memory, Progress* progress) {
  const auto start = std::chrono::steady_clock::now();
  GatherOperator op;
  op.setup_ = &setup;
  const size_t n = setup.receivers.count();
  op.buried_.assign(n, 0);
  op.kept_ = std::make_shared<KeptRows>(op.blocks(), hits ? memory : 0,
                                        most_bytes(size_t(setup.sets.samples), n, setup.channels));
  op.gathered_ = std::make_shared<Pool<GatherBlock>>([] { return std::make_unique<GatherBlock>(); });
  op.scratch_ = std::make_shared<Pool<GatherScratch, DeleteScratch>>([&setup] { return make_gather_scratch(setup); });
  ProgressStage stage(progress, "tracing", n);
  parallel_for(n, gather_block, [&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    auto block = op.gathered_->borrow();
    std::vector<float> unwanted(sky_rows ? 0 : (end - begin) * setup.coefficients());
    const GatherSky sky{sky_rows ? sky_rows + begin * setup.coefficients() : unwanted.data(), nullptr,
                        setup.coefficients(), nullptr, op.buried_.data() + begin};
    auto scratch = op.scratch_->borrow();
    if (direct) {
      const GatherDirect here{direct->lamps, direct->samples, direct->rows + begin * direct->width, direct->width};
      trace_gather(setup, *scratch, begin, end - begin, hits ? block.get() : nullptr, &sky, &here);
    } else {
      trace_gather(setup, *scratch, begin, end - begin, hits ? block.get() : nullptr, &sky);
    }
    stage.advance(end - begin);
    if (!hits) return;
    block->half_rows = {};
    op.kept_->keep(begin / gather_block, *block);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  op.fill_ = make_fill_steps(setup.scene, setup.receivers.basis, op.buried_);
  if (direct) fill_buried(op.fill_, direct->rows, direct->width, 3 * direct->lamps.groups());
  if (sky_rows) fill_buried(op.fill_, sky_rows, setup.coefficients(), setup.coefficients());
  for (uint8_t b : op.buried_) op.report_.buried += b;
  op.report_.rays = n * size_t(setup.sets.samples), op.report_.bytes = op.kept_->bytes();
  op.report_.kept = op.kept_->fraction();
  op.report_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return op;
}

void GatherOperator::with_rows(size_t b, auto f) const {
  if (const KeptRows::Block* kept = kept_->find(b)) return f(kept->rows);
  const size_t begin = b * gather_block;
  auto again = gathered_->borrow();
  trace_gather(*setup_, *scratch_->borrow(), begin, std::min(gather_block, rows() - begin), again.get(), nullptr);
  f(again->rows.view());
}

void GatherOperator::apply_block(size_t b, const float* x, size_t width, float* y) const {
  with_rows(b, [&](const SparseRows& rows) {
    multiply_rows(rows, setup_->channels, x, width, setup_->row_scale(size_t(setup_->sets.samples)), y);
  });
}

void GatherOperator::apply(const float* x, size_t width, float* y) const {
  parallel_for(blocks(), 1, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) apply_block(b, x, width, y + b * gather_block * width);
  });
  fill(y, width);
  report_.rays += size_t(double(rows()) * (1 - report_.kept) + 0.5) * size_t(setup_->sets.samples);
}

GatherOperator::Push GatherOperator::transposed() const {
  Push push;
  push.channels = setup_->channels;
  push.first.assign(rows() + 1, 0);
  const size_t channels = size_t(push.channels);
  auto each_entry = [&](auto f) {
    for (size_t b = 0; b < blocks(); ++b)
      with_rows(b, [&](const SparseRows& rows) {
        const SparseEntries& s = rows.entries;
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
