// Follows: local-deformable-prt, section 4.1: lobe by lobe on the residual, then all together, then from random axes
// where the error is high; besides, from the neighbours' lobes.
#include <lambent/basis/zonal.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/compress/zonal_kernel.h>
#include <lambent/core/check.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/half.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <array>
#include <atomic>
#include <cstring>

namespace lambent {
namespace {

static_assert(max_stored_lobes == max_zonal_lobes);

constexpr int hemicube_cells = 6;  // 108 directions, some 14 degrees apart
constexpr size_t chain = 64;       // receivers that one lane fits one after another
constexpr size_t fit_block = chain * zonal_lanes;
constexpr double single_tolerance = 1e-3, joint_tolerance = 1e-5;

// What a thread works with.
struct Scratch {
  ZonalBatch batch, single;
  std::vector<double> targets, axes,
      psi;  // of a block's receivers: [receiver][channel][order^2], [receiver][lobe][3], [receiver]
};

class BlockFit {
 public:
  // Of transfer and result with one row.
  BlockFit(const Transfer& t, const WritableZonalTransfer& out, const ZonalFitOptions& options,
           const ZonalStarts& starts, Scratch& s, size_t begin, size_t end)
      : out_(out),
        options_(options),
        starts_(starts),
        s_(s),
        begin_(begin),
        count_(end - begin),
        N_(size_t(options.lobes)),
        values_(t.receiver_values()) {
    s.targets.resize(count_ * values_), s.axes.assign(count_ * 3 * N_, 0.0), s.psi.assign(count_, INFINITY);
    for (size_t r = 0; r < count_; ++r) {
      const std::vector<float> row = load_receiver(t, begin + r);
      std::copy(row.begin(), row.end(), s.targets.begin() + ptrdiff_t(r * values_));
      for (size_t i = 0; i < N_; ++i) s.axes[(r * N_ + i) * 3 + 2] = 1;
    }
  }

  // Returns how many receivers were searched again.
  size_t search() {
    for (size_t i = 0; i < chain; ++i) {
      choose([&](size_t lane) { return lane * chain + i; });
      if (!any()) break;
      if (i > 0) from([](size_t r) { return r - 1; });
      lobe_by_lobe();
    }
    std::vector<size_t> poor;
    for (size_t r = 0; r < count_; ++r)
      if (s_.psi[r] > double(options_.retry) * options_.retry * energy(r)) poor.push_back(r);
    for (size_t first = 0; first < poor.size() && options_.starts > 0; first += zonal_lanes) {
      choose([&](size_t lane) { return first + lane < poor.size() ? poor[first + lane] : count_; });
      for (int start = 0; start < options_.starts; ++start) from_random(start);
    }
    if (!poor.empty())
      for (int sweep = 0; sweep < 2; ++sweep)
        for (size_t i = 1; i < chain; ++i) {
          // Backward, then forward again: what was found travels both ways.
          choose([&](size_t lane) { return lane * chain + (sweep == 0 ? chain - 1 - i : i); });
          if (any()) from([&](size_t r) { return sweep == 0 ? std::min(r + 1, count_ - 1) : r - 1; });
        }
    for (size_t r = 1; r < count_; ++r) correspond(&s_.axes[(r - 1) * 3 * N_], &s_.axes[r * 3 * N_]);
    return options_.starts > 0 ? poor.size() : 0;
  }

  // Stores the fits; gives each receiver's squared error and squared length.
  void store(std::vector<double>& errors, std::vector<double>& energies) {
    const ZonalTransfer& z = out_.transfer;
    const int exact = z.exact_bands();
    std::vector<float> values(z.receiver_values());
    for (size_t first = 0; first < count_; first += zonal_lanes) {
      choose([&](size_t lane) { return first + lane; });
      load_targets(s_.batch);
      // The coefficients are those best for the axes as stored.
      for (size_t lane = 0; lane < zonal_lanes; ++lane)
        for (size_t i = 0; i < N_; ++i) {
          const double* a = &s_.axes[(std::min(receivers_[lane], count_ - 1) * N_ + i) * 3];
          Vec3d axis;
          for (int k = 0; k < 3; ++k) {
            const float stored = float(a[k]);
            axis[k] = z.precision == Precision::half ? half_to_float(float_to_half(stored)) : stored;
          }
          axis = normalize(axis);
          for (int k = 0; k < 3; ++k) s_.batch.axis(int(i), k)[lane] = axis[k];
        }
      if (z.order > exact) refine_zonal(s_.batch, {0, 0, options_.ridge});
      for (size_t lane = 0; lane < zonal_lanes; ++lane) {
        const size_t r = receivers_[lane];
        if (r >= count_) continue;
        const double* t = &s_.targets[r * values_];
        float* v = values.data();
        for (int c = 0; c < z.channels; ++c)
          for (int k = 0; k < sh_count(exact); ++k) *v++ = float(t[c * sh_count(z.order) + k]);
        for (int i = 0; i < z.lobes; ++i) {
          for (int k = 0; k < 3; ++k) *v++ = float(s_.axes[(r * N_ + size_t(i)) * 3 + size_t(k)]);
          for (int c = 0; c < z.channels; ++c)
            for (int l = exact; l < z.order; ++l) *v++ = float(s_.batch.coefficient(c, l, i)[lane]);
        }
        store_receiver(out_, begin_ + r, values);
        const std::vector<float> fit = zonal_harmonics(z, load_receiver(z, begin_ + r));
        double error = 0;
        for (size_t k = 0; k < values_; ++k) error += (fit[k] - t[k]) * (fit[k] - t[k]);
        errors[begin_ + r] = error, energies[begin_ + r] = energy(r);
      }
    }
  }

 private:
  double energy(size_t r) const {
    double sum = 0;
    for (size_t k = 0; k < values_; ++k) sum += s_.targets[r * values_ + k] * s_.targets[r * values_ + k];
    return sum;
  }

  // The receivers that the lanes work on; those beyond the block are idle.
  template <class F>
  void choose(F receiver) {
    for (size_t lane = 0; lane < zonal_lanes; ++lane) receivers_[lane] = std::min(receiver(lane), count_);
    load_targets(s_.batch);
  }
  bool any() const {
    return std::any_of(receivers_.begin(), receivers_.end(), [&](size_t r) { return r < count_; });
  }
  void load_targets(ZonalBatch& b) const {
    for (size_t k = 0; k < values_; ++k)
      for (size_t lane = 0; lane < zonal_lanes; ++lane)
        b.t[k * zonal_lanes + lane] = receivers_[lane] < count_ ? s_.targets[receivers_[lane] * values_ + k] : 0.0;
  }
  void set_axis(ZonalBatch& b, size_t lane, size_t lobe, const double* axis) const {
    for (int k = 0; k < 3; ++k) b.axis(int(lobe), k)[lane] = axis[k];
  }

  // Refines what is in the batch and keeps it where it is better than what was there.
  void refine_and_keep() {
    refine_zonal(s_.batch, {40, joint_tolerance, options_.ridge});
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      const size_t r = receivers_[lane];
      if (r >= count_ || !(s_.batch.psi[lane] < s_.psi[r])) continue;
      s_.psi[r] = s_.batch.psi[lane];
      for (size_t i = 0; i < N_; ++i)
        for (int k = 0; k < 3; ++k) s_.axes[(r * N_ + i) * 3 + size_t(k)] = s_.batch.axis(int(i), k)[lane];
    }
  }

  template <class F>
  void from(F neighbour) {
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      if (receivers_[lane] >= count_) continue;
      for (size_t i = 0; i < N_; ++i) set_axis(s_.batch, lane, i, &s_.axes[(neighbour(receivers_[lane]) * N_ + i) * 3]);
    }
    refine_and_keep();
  }

  void from_random(int start) {
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      Random random(begin_ + receivers_[lane], uint64_t(options_.seed) << 32 | uint64_t(start));
      for (size_t i = 0; i < N_; ++i) {
        const Vec2 u = random.next2();
        const double z = 2 * double(u.x) - 1, phi = 2 * std::numbers::pi * u.y, rho = std::sqrt(1 - z * z);
        const double axis[3] = {rho * std::cos(phi), rho * std::sin(phi), z};
        set_axis(s_.batch, lane, i, axis);
      }
    }
    refine_and_keep();
  }

  void lobe_by_lobe() {
    ZonalBatch& one = s_.single;
    load_targets(one);
    for (size_t i = 0; i < N_; ++i) {
      choose_start(one, starts_);
      refine_zonal(one, {8, single_tolerance, options_.ridge});
      for (size_t lane = 0; lane < zonal_lanes; ++lane)
        for (int k = 0; k < 3; ++k) s_.batch.axis(int(i), k)[lane] = one.axis(0, k)[lane];
      std::vector<double>& residual = residual_;
      residual.resize(one.t.size());
      zonal_residual(one, residual.data());
      std::copy(residual.begin(), residual.end(), one.t.begin());
    }
    refine_and_keep();
  }

  // Numbers and turns the lobes of `axes` as close to those of `model` as can be, the closest pairs first.
  void correspond(const double* model, double* axes) const {
    std::array<double, 3 * max_zonal_lobes> ordered;
    std::array<bool, max_zonal_lobes> used{}, placed{};
    for (size_t pair = 0; pair < N_; ++pair) {
      size_t from = 0, to = 0;
      double best = -1, sign = 1;
      for (size_t i = 0; i < N_; ++i)
        for (size_t j = 0; j < N_; ++j) {
          if (placed[i] || used[j]) continue;
          const double cosine = model[3 * i] * axes[3 * j] + model[3 * i + 1] * axes[3 * j + 1] +
                                model[3 * i + 2] * axes[3 * j + 2];
          if (std::abs(cosine) > best) best = std::abs(cosine), to = i, from = j, sign = cosine < 0 ? -1 : 1;
        }
      placed[to] = used[from] = true;
      for (size_t k = 0; k < 3; ++k) ordered[3 * to + k] = sign * axes[3 * from + k];
    }
    std::copy_n(ordered.begin(), 3 * N_, axes);
  }

  const WritableZonalTransfer& out_;
  const ZonalFitOptions& options_;
  const ZonalStarts& starts_;
  Scratch& s_;
  size_t begin_, count_, N_, values_;
  std::array<size_t, zonal_lanes> receivers_{};
  std::vector<double> residual_;
};

Result<void> check(const Transfer& t, const ZonalFitOptions& o) {
  if (o.lobes < 1 || o.lobes > max_zonal_lobes)
    return Error{"lobes",
                 "must lie between 1 and " + std::to_string(max_zonal_lobes) + ", not " + std::to_string(o.lobes)};
  if (o.starts < 0 || o.starts > 1000)
    return Error{"starts", "must lie between 0 and 1000, not " + std::to_string(o.starts)};
  if (!(o.retry >= 0 && o.retry <= 1)) return Error{"retry", "must lie between 0 and 1"};
  if (!(o.ridge >= 0 && o.ridge <= 1)) return Error{"ridge", "must lie between 0 and 1"};
  if (t.columns() != size_t(sh_count(t.light.order)) || t.light.order < 1)
    return Error{"", "zonal lobes are fitted to transfer of spherical harmonics alone"};
  LAMBENT_CHECK(o.row_weights.empty() || o.row_weights.size() == size_t(t.rows));
  return {};
}

// Row `row` of a transfer, as one of its own. Rows of a block lie side by side, so that this is a copy of pieces;
// likewise below.
Transfer transfer_row(const Transfer& t, int row) {
  if (t.rows == 1) return t;
  const WritableTransfer w = make_transfer(t.light, 1, t.channels, t.receivers, t.precision);
  const size_t piece = w.transfer.block_values() * t.value_bytes();
  for (size_t b = 0; b < t.blocks(); ++b)
    std::memcpy(w.values + b * piece, t.data.data() + (b * size_t(t.rows) + size_t(row)) * piece, piece);
  return w.transfer;
}

void gather_stored(const Shares& shares, const WritableZonalTransfer& out) {
  const size_t block = stored_bytes(out, 0, transfer_block).size();
  shares.gather_each(transfer_block, out.values, block);
}

void put_row(const WritableZonalTransfer& out, int row, const ZonalTransfer& from) {
  const size_t piece = from.row_values() * transfer_block * from.value_bytes();
  for (size_t b = 0; b < from.blocks(); ++b)
    std::memcpy(out.values + (b * size_t(out.transfer.rows) + size_t(row)) * piece, from.data.data() + b * piece,
                piece);
}

}  // namespace

Result<ZonalTransfer> fit_zonal(const Transfer& t, const ZonalFitOptions& options, ZonalFitReport* report,
                                Progress* progress) {
  const auto start = Clock::now();
  if (auto ok = check(t, options); !ok) return ok.error();
  const int order = t.light.order, exact = exact_zonal_bands(order, options.lobes);
  WritableZonalTransfer out =
      make_zonal_transfer(order, options.lobes, t.channels, t.receivers, options.precision, t.rows);
  const ZonalStarts starts = make_zonal_starts(order, hemicube_cells);
  const int first_band = std::min(exact, order - 1);  // where all is exact, the last band is fitted for nothing
  Pool<Scratch> pool([&] {
    return std::make_unique<Scratch>(Scratch{make_zonal_batch(order, first_band, t.channels, options.lobes),
                                             make_zonal_batch(order, first_band, t.channels, 1),
                                             {},
                                             {},
                                             {}});
  });
  std::vector<double> errors(t.receivers), energies(t.receivers), error(t.receivers), energy(t.receivers);
  std::atomic<size_t> retried{0};
  {
    const Shares shares(t.receivers, fit_block);
    ProgressStage stage(progress, "fitting lobes", shares.own() * size_t(t.rows));
    const size_t blocks = (t.receivers + fit_block - 1) / fit_block;
    const KeptPieces pieces(progress, "fitting", blocks * size_t(t.rows));
    for (int row = 0; row < t.rows; ++row) {
      const Transfer target = transfer_row(t, row);
      const WritableZonalTransfer fitted =
          t.rows == 1 ? out : make_zonal_transfer(order, options.lobes, t.channels, t.receivers, options.precision);
      shares.for_own([&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        const size_t piece = size_t(row) * blocks + begin / fit_block, count = end - begin;
        const std::span<uint8_t> bytes = stored_bytes(fitted, begin, count);
        const std::span<double> errors_there(error.data() + begin, count), energies_there(energy.data() + begin, count);
        size_t again = 0;
        if (!pieces.load(piece, bytes, errors_there, energies_there, again)) {
          auto scratch = pool.borrow();
          BlockFit fit(target, fitted, options, starts, *scratch, begin, end);
          if (order > exact) again = fit.search();
          fit.store(error, energy);
          pieces.save(piece, bytes, errors_there, energies_there, again);
        }
        retried += again;
        stage.advance(end - begin);
      });
      if (!none_cancelled(progress)) return Error{"", "cancelled"};
      shares.gather(error.data()), shares.gather(energy.data());
      gather_stored(shares, fitted);
      if (t.rows > 1) put_row(out, row, fitted.transfer);
      const double weight = options.row_weights.empty() ? 1 : double(options.row_weights[size_t(row)]);
      for (size_t r = 0; r < t.receivers; ++r) errors[r] += weight * error[r], energies[r] += weight * energy[r];
    }
  }
  if (report) {
    double sum = 0, total = 0;
    report->errors.resize(t.receivers);
    for (size_t r = 0; r < t.receivers; ++r) {
      sum += errors[r], total += energies[r];
      report->errors[r] = energies[r] > 0 ? float(std::sqrt(errors[r] / energies[r])) : 0.0f;
    }
    report->rms = total > 0 ? std::sqrt(sum / total) : 0;
    report->retried = this_ranks().sum(retried);
    report->seconds = seconds_since(start);
  }
  return std::move(out.transfer);
}

}  // namespace lambent
