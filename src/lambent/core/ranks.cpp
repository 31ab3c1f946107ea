#include <lambent/core/ranks.h>

#include <algorithm>

namespace lambent {
namespace {

constexpr size_t stripes_a_rank = 16;

Ranks one_process;
thread_local Ranks* current = nullptr;

// What each rank has goes round in a ring: mine is handed on, then what came, until all have seen all.
template <class Size, class Take>
void hand_round(Ranks& ranks, std::vector<uint8_t> mine, Size size_of, Take take) {
  const size_t n = size_t(ranks.count()), rank = size_t(ranks.rank()), next = (rank + 1) % n,
               before = (rank + n - 1) % n;
  std::vector<uint8_t> in;
  std::vector<std::span<const uint8_t>> give(n);
  std::vector<std::span<uint8_t>> get(n);
  for (size_t step = 1; step < n; ++step) {
    const size_t from = (rank + n - step) % n;
    in.resize(size_of(from));
    give[next] = mine, get[before] = in;
    ranks.exchange(give, get);
    take(from, in);
    std::swap(mine, in);
  }
}

}  // namespace

std::vector<std::vector<uint8_t>> Ranks::gather(std::vector<uint8_t> mine) {
  const size_t n = size_t(count());
  std::vector<std::vector<uint8_t>> out(n);
  std::vector<uint64_t> sizes(n);
  std::vector<uint8_t> own(sizeof(uint64_t));
  const uint64_t size = mine.size();
  std::memcpy(own.data(), &size, sizeof size);
  if (n > 1) {
    hand_round(
        *this, own, [](size_t) { return sizeof(uint64_t); },
        [&](size_t from, const std::vector<uint8_t>& in) { std::memcpy(&sizes[from], in.data(), sizeof size); });
    hand_round(
        *this, mine, [&](size_t from) { return size_t(sizes[from]); },
        [&](size_t from, const std::vector<uint8_t>& in) { out[from] = in; });
  }
  out[size_t(rank())] = std::move(mine);
  return out;
}

uint64_t Ranks::sum(uint64_t mine) {
  if (count() == 1) return mine;
  std::vector<uint8_t> own(sizeof mine);
  std::memcpy(own.data(), &mine, sizeof mine);
  uint64_t out = 0, one;
  for (const auto& bytes : gather(own)) std::memcpy(&one, bytes.data(), sizeof one), out += one;
  return out;
}

Ranks& this_ranks() { return current ? *current : one_process; }

WithRanks::WithRanks(Ranks& ranks) : outer_(current) { current = &ranks; }
WithRanks::~WithRanks() { current = outer_; }

bool none_cancelled(Progress* progress) {
  const bool well = this_ranks().all(!is_cancelled(progress));
  if (!well) progress->cancel();
  return well;
}

Shares::Shares(size_t count, size_t grain) : Shares(count, grain, &this_ranks()) {}

Shares::Shares(size_t count, size_t grain, Ranks* ranks)
    : ranks_(ranks ? ranks : &one_process),
      rank_(ranks_->rank()),
      size_(ranks_->count()),
      count_(count),
      grain_(grain),
      stripes_(std::max<size_t>(std::min(pieces(), size_t(size_) * stripes_a_rank), 1)) {
  // As many for each, where there are enough.
  if (stripes_ > size_t(size_)) stripes_ -= stripes_ % size_t(size_);
}

size_t Shares::size_of(int rank) const {
  size_t items = 0;
  if (count_ > 0) each_stripe(rank, [&](size_t begin, size_t end) { items += end - begin; });
  return items;
}

void Shares::for_own(PieceBody body) const {
  if (size_ == 1) return parallel_for(count_, grain_, body);
  if (count_ == 0) return;
  std::vector<size_t> own;
  each_stripe(rank_, [&](size_t begin, size_t end) {
    for (size_t at = begin; at < end; at += grain_) own.push_back(at);
  });
  parallel_for(own.size(), 1, [&](size_t i, size_t) { body(own[i], std::min(count_, own[i] + grain_)); });
}

Shares Shares::by(size_t items) const {
  Shares out = *this;
  out.count_ = (count_ + items - 1) / items, out.grain_ = grain_ / items;
  return out;
}

void Shares::gather_bytes(uint8_t* rows, size_t each) const {
  if (count_ == 0 || each == 0) return;
  std::vector<uint8_t> mine;
  mine.reserve(own() * each);
  each_stripe(rank_,
              [&](size_t begin, size_t end) { mine.insert(mine.end(), rows + begin * each, rows + end * each); });
  hand_round(
      *ranks_, std::move(mine), [&](size_t from) { return size_of(int(from)) * each; },
      [&](size_t from, const std::vector<uint8_t>& in) {
        const uint8_t* at = in.data();
        each_stripe(int(from), [&](size_t begin, size_t end) {
          std::memcpy(rows + begin * each, at, (end - begin) * each), at += (end - begin) * each;
        });
      });
}

}  // namespace lambent
