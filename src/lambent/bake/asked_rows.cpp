#include <lambent/bake/asked_rows.h>

#include <algorithm>

namespace lambent {
namespace {

constexpr size_t rows_at_once = size_t{1} << 15, most_parts = 16;  // so that what is on its way takes little memory

template <class T>
std::span<const uint8_t> sent(const std::vector<T>& v) {
  return {reinterpret_cast<const uint8_t*>(v.data()), v.size() * sizeof(T)};
}
template <class T>
std::span<uint8_t> received(std::vector<T>& v) {
  return {reinterpret_cast<uint8_t*>(v.data()), v.size() * sizeof(T)};
}

template <class T>
void exchange_all(Ranks& ranks, const std::vector<std::vector<T>>& give, std::vector<std::vector<T>>& take) {
  std::vector<std::span<const uint8_t>> from;
  std::vector<std::span<uint8_t>> to;
  for (const auto& g : give) from.push_back(sent(g));
  for (auto& t : take) to.push_back(received(t));
  ranks.exchange(from, to);
}

}  // namespace

AskedRows::AskedRows(const Shares& shares, const std::vector<uint8_t>& asked)
    : shares_(shares), parts_(std::clamp<size_t>(asked.size() / rows_at_once, 1, most_parts)) {
  if (shares.alone()) return;
  Ranks& ranks = shares.ranks();
  const size_t n = size_t(ranks.count());
  take_.resize(n), give_.resize(n);
  for (size_t row = 0; row < asked.size(); ++row)
    if (asked[row])
      if (const int owner = shares.owner(row); owner != ranks.rank()) take_[size_t(owner)].push_back(uint32_t(row));
  std::vector<std::vector<uint64_t>> counts(n), theirs(n, std::vector<uint64_t>(1));
  for (size_t k = 0; k < n; ++k) counts[k] = {take_[k].size()};
  exchange_all(ranks, counts, theirs);
  for (size_t k = 0; k < n; ++k)
    if (int(k) != ranks.rank()) give_[k].resize(theirs[k][0]);
  exchange_all(ranks, take_, give_);
}

void AskedRows::fetch(float* x, const Place& place) const {
  if (take_.empty()) return;
  Ranks& ranks = shares_.ranks();
  const auto part_of = [&](const std::vector<uint32_t>& rows, size_t part) {
    const size_t first = rows.size() * part / parts_;
    return std::span(rows).subspan(first, rows.size() * (part + 1) / parts_ - first);
  };
  for (size_t part = 0; part < parts_; ++part) {
    std::vector<std::vector<float>> out(give_.size()), in(take_.size());
    for (size_t k = 0; k < give_.size(); ++k) {
      for (uint32_t row : part_of(give_[k], part)) {
        const auto [at, count] = place(row);
        out[k].insert(out[k].end(), x + at, x + at + count);
      }
      size_t values = 0;
      for (uint32_t row : part_of(take_[k], part)) values += place(row).second;
      in[k].resize(values);
      ranks.asked_bytes += values * sizeof(float);
    }
    exchange_all(ranks, out, in);
    for (size_t k = 0; k < take_.size(); ++k) {
      const float* from = in[k].data();
      for (uint32_t row : part_of(take_[k], part)) {
        const auto [at, count] = place(row);
        std::copy_n(from, count, x + at), from += count;
      }
    }
  }
}

void forget_others(const Shares& shares, ZeroPages& x, size_t width) {
  for (int k = 0; k < shares.ranks().count(); ++k)
    if (k != shares.ranks().rank())
      shares.each_stripe(k, [&](size_t begin, size_t end) { x.forget(begin * width, end * width); });
}

}  // namespace lambent
