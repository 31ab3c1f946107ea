// Follows: general-prt, "Clustered PCA". Clusters begin as runs of receivers along their space-filling curve, so as
// neighbours on the surface; then each receiver goes to whichever of the nearest clusters represents it best, and each
// cluster's components are found anew by subspace iteration.
#include <lambent/compress/cpca.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <numeric>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/compress/cpca.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, 16>;

// n a multiple of 16.
float Dot(const float* a, const float* b, size_t n) {
  const F d;
  auto s0 = hn::Zero(d), s1 = s0;
  size_t i = 0;
  for (; i + 2 * hn::Lanes(d) <= n; i += 2 * hn::Lanes(d)) {
    s0 = hn::MulAdd(hn::LoadU(d, a + i), hn::LoadU(d, b + i), s0);
    s1 = hn::MulAdd(hn::LoadU(d, a + i + hn::Lanes(d)), hn::LoadU(d, b + i + hn::Lanes(d)), s1);
  }
  for (; i < n; i += hn::Lanes(d)) s0 = hn::MulAdd(hn::LoadU(d, a + i), hn::LoadU(d, b + i), s0);
  return hn::GetLane(hn::SumOfLanes(d, hn::Add(s0, s1)));
}

void AddScaled(float f, const float* a, size_t n, float* out) {
  const F d;
  for (size_t i = 0; i < n; i += hn::Lanes(d))
    hn::StoreU(hn::MulAdd(hn::Set(d, f), hn::LoadU(d, a + i), hn::LoadU(d, out + i)), d, out + i);
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(Dot);
HWY_EXPORT(AddScaled);
float dot(const float* a, const float* b, size_t n) { return HWY_DYNAMIC_DISPATCH(Dot)(a, b, n); }
void add_scaled(float f, const float* a, size_t n, float* out) { HWY_DYNAMIC_DISPATCH(AddScaled)(f, a, n, out); }

constexpr size_t near_clusters = 8;  // tried for each receiver in every iteration
constexpr int power_steps = 5;       // of subspace iteration a fit; the next fit goes on from this one's components

size_t padded(size_t n) { return (n + 15) / 16 * 16; }

struct Cluster {
  std::vector<float> mean;
  std::vector<std::vector<float>> components;  // orthonormal
};

struct Compressor {
  const Transfer& transfer;
  const CpcaOptions& options;
  ProgressStage& stage;  // advanced by receivers: those of a cluster when it is fitted, each when it is assigned
  Progress* progress;
  size_t n = transfer.receivers, D = transfer.receiver_values(), stride = padded(D);
  std::vector<float> values = std::vector<float>(n * stride, 0.0f);  // [receiver][stride]
  std::vector<Cluster> clusters = std::vector<Cluster>(size_t(options.clusters));
  std::vector<uint16_t> cluster_of = std::vector<uint16_t>(n);

  const float* value(size_t r) const { return values.data() + r * stride; }

  void unpack() {
    parallel_for(n, 256, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r) {
        const std::vector<float> v = load_receiver(transfer, r);
        std::copy(v.begin(), v.end(), values.begin() + ptrdiff_t(r * stride));
      }
    });
    for (size_t r = 0; r < n; ++r) cluster_of[r] = uint16_t(r * size_t(options.clusters) / n);
  }

  // Mean and principal components of the members: (A^T A)^k applied to a few vectors, made orthonormal after each step.
  void fit(size_t c, const std::vector<uint32_t>& members) {
    Cluster& cluster = clusters[c];
    if (members.empty()) return;  // keeps what it was: receivers may come back
    cluster.mean.assign(stride, 0.0f);
    for (uint32_t r : members) add_scaled(1.0f / float(members.size()), value(r), stride, cluster.mean.data());
    auto& Q = cluster.components;
    Random random(c, 0xcbca);
    while (Q.size() < size_t(options.rank)) {
      Q.emplace_back(stride, 0.0f);
      for (size_t k = 0; k < D; ++k) Q.back()[k] = random.next() - 0.5f;
    }
    std::vector<float> centred(stride);
    for (int step = 0; step < power_steps && !stage.cancelled(); ++step) {
      std::vector<std::vector<float>> Y(Q.size(), std::vector<float>(stride, 0.0f));
      for (uint32_t r : members) {
        for (size_t k = 0; k < stride; ++k) centred[k] = value(r)[k] - cluster.mean[k];
        for (size_t i = 0; i < Q.size(); ++i)
          add_scaled(dot(Q[i].data(), centred.data(), stride), centred.data(), stride, Y[i].data());
      }
      Q = std::move(Y);
      for (size_t i = 0; i < Q.size(); ++i) {
        const float before = std::sqrt(dot(Q[i].data(), Q[i].data(), stride));
        for (int again = 0; again < 2; ++again)
          for (size_t j = 0; j < i; ++j)
            add_scaled(-dot(Q[i].data(), Q[j].data(), stride), Q[j].data(), stride, Q[i].data());
        const float after = std::sqrt(dot(Q[i].data(), Q[i].data(), stride));
        // Fewer members than components, or all alike: what is left is rounding.
        const float scale = after > 1e-5f * before && after > 0 ? 1 / after : 0.0f;
        for (float& x : Q[i]) x *= scale;
      }
    }
  }

  // Squared error of receiver r in a cluster; weights into out, if given.
  double error(const Cluster& cluster, size_t r, std::vector<float>& centred, float* out) const {
    for (size_t k = 0; k < stride; ++k) centred[k] = value(r)[k] - cluster.mean[k];
    double left = dot(centred.data(), centred.data(), stride);
    for (size_t i = 0; i < cluster.components.size(); ++i) {
      const float w = dot(centred.data(), cluster.components[i].data(), stride);
      left -= double(w) * w;
      if (out) out[i] = w;
    }
    return std::max(left, 0.0);
  }

  void fit_all() {
    std::vector<std::vector<uint32_t>> members(clusters.size());
    for (size_t r = 0; r < n; ++r) members[cluster_of[r]].push_back(uint32_t(r));
    const Shares shares(clusters.size(), 1);
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      for (size_t c = begin; c < end; ++c) fit(c, members[c]), stage.advance(members[c].size());
    });
    if (shares.alone() || !none_cancelled(progress)) return;
    const size_t vectors = 1 + size_t(options.rank);
    std::vector<float> all(clusters.size() * vectors * stride);
    auto each_vector = [&](auto f) {
      for (size_t c = 0; c < clusters.size(); ++c) {
        clusters[c].mean.resize(stride), clusters[c].components.resize(vectors - 1, std::vector<float>(stride));
        float* at = all.data() + c * vectors * stride;
        f(clusters[c].mean.data(), at);
        for (std::vector<float>& q : clusters[c].components) f(q.data(), at += stride);
      }
    };
    each_vector([&](const float* own, float* to) { std::copy_n(own, stride, to); });
    shares.gather(all.data(), vectors * stride);
    each_vector([&](float* own, const float* from) { std::copy_n(from, stride, own); });
  }

  // Each receiver to whichever of the clusters with the nearest means leaves least error.
  void assign() {
    const Shares shares(n, 64);
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      std::vector<std::pair<float, uint16_t>> near(clusters.size());
      std::vector<float> centred(stride);
      for (size_t r = begin; r < end; ++r) {
        near.clear();
        for (size_t c = 0; c < clusters.size(); ++c)  // |v - m|^2 less |v|^2
          near.push_back({dot(clusters[c].mean.data(), clusters[c].mean.data(), stride) -
                              2 * dot(value(r), clusters[c].mean.data(), stride),
                          uint16_t(c)});
        const size_t tried = std::min(near_clusters, near.size());
        std::partial_sort(near.begin(), near.begin() + ptrdiff_t(tried), near.end());
        uint16_t best = cluster_of[r];
        double least = error(clusters[best], r, centred, nullptr);
        for (size_t i = 0; i < tried; ++i)
          if (const double e = error(clusters[near[i].second], r, centred, nullptr); e < least)
            least = e, best = near[i].second;
        cluster_of[r] = best;
      }
      stage.advance(end - begin);
    });
    if (none_cancelled(progress)) shares.gather(cluster_of.data());
  }
};

}  // namespace

Result<CpcaTransfer> compress_cpca(const Transfer& transfer, const CpcaOptions& options, double* error,
                                   Progress* progress) {
  if (options.clusters < 1 || size_t(options.clusters) > std::min<size_t>(transfer.receivers, 65535))
    return Error{"clusters", "must lie between 1 and the number of receivers (at most 65535), not " +
                                 std::to_string(options.clusters)};
  if (options.rank < 0 || options.rank > 64)
    return Error{"rank", "must lie between 0 and 64, not " + std::to_string(options.rank)};
  if (options.iterations < 1 || options.iterations > 64)
    return Error{"iterations", "must lie between 1 and 64, not " + std::to_string(options.iterations)};
  ProgressStage stage(progress, "clustering",
                      transfer.receivers * size_t(2 * options.iterations + 1) / size_t(this_ranks().count()));
  Compressor c{transfer, options, stage, progress};
  c.unpack();
  c.fit_all();
  for (int i = 0; i < options.iterations && none_cancelled(progress); ++i) c.assign(), c.fit_all();
  if (!none_cancelled(progress)) return Error{"", "cancelled"};

  CpcaTransfer out;
  out.light = transfer.light, out.rows = transfer.rows, out.channels = transfer.channels,
  out.receivers = transfer.receivers;
  out.clusters = options.clusters, out.rank = options.rank, out.cluster_of = c.cluster_of;
  const size_t rank = size_t(options.rank);
  for (Cluster& cluster : c.clusters) {
    if (cluster.mean.empty()) cluster.mean.assign(c.stride, 0.0f);
    cluster.components.resize(rank, std::vector<float>(c.stride, 0.0f));
    out.vectors.insert(out.vectors.end(), cluster.mean.begin(), cluster.mean.begin() + ptrdiff_t(c.D));
    for (const auto& q : cluster.components)
      out.vectors.insert(out.vectors.end(), q.begin(), q.begin() + ptrdiff_t(c.D));
  }
  out.weights.resize(c.n * rank);
  std::vector<double> errors(c.n), sizes(c.n);
  parallel_for(c.n, 256, [&](size_t begin, size_t end) {
    std::vector<float> centred(c.stride), w(rank);
    for (size_t r = begin; r < end; ++r) {
      (void)c.error(c.clusters[c.cluster_of[r]], r, centred, w.data());
      for (size_t i = 0; i < rank; ++i) out.weights[r * rank + i] = float_to_half(w[i]);
      const std::vector<float> back = load_receiver(out, r);
      for (size_t k = 0; k < c.D; ++k) {
        const double d = double(back[k]) - c.value(r)[k];
        errors[r] += d * d, sizes[r] += double(c.value(r)[k]) * c.value(r)[k];
      }
    }
  });
  const double difference = std::accumulate(errors.begin(), errors.end(), 0.0),
               total = std::accumulate(sizes.begin(), sizes.end(), 0.0);
  if (error) *error = total > 0 ? std::sqrt(difference / total) : 0;
  return out;
}

}  // namespace lambent
#endif
