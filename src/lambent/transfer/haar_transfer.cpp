#include <lambent/transfer/haar_columns.h>

#include <lambent/core/check.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace lambent {
namespace {

constexpr int haar_steps = 127;
constexpr int max_haar_size = 256;
constexpr size_t tiles_bytes = sizeof(uint64_t);

uint64_t tiles_of(std::span<const uint8_t> column) {
  uint64_t tiles = 0;
  std::memcpy(&tiles, column.data(), tiles_bytes);
  return tiles;
}

// Calls take(receiver in chunk, value) for the entries of a column that is what it promises.
template <class Take>
void each_entry(std::span<const uint8_t> column, Take&& take) {
  if (column.empty()) return;
  const uint8_t* p = column.data() + tiles_bytes;
  for (uint64_t tiles = tiles_of(column); tiles; tiles &= tiles - 1) {
    const size_t tile = size_t(std::countr_zero(tiles)) * haar_tile;
    const size_t count = *p++;
    if (count == 0) {
      for (size_t r = 0; r < haar_tile; ++r)
        if (p[r]) take(tile + r, int(int8_t(p[r])));
      p += haar_tile;
    }
    for (size_t i = 0; i < count; ++i, p += 2) take(tile + p[0], int(int8_t(p[1])));
  }
}

struct PlacedValue {
  uint16_t receiver;
  int8_t value;
};

// Entries by rising receiver, at least one.
void append_column(std::span<const PlacedValue> entries, std::vector<uint8_t>& out) {
  uint64_t tiles = 0;
  for (const PlacedValue& e : entries) tiles |= uint64_t{1} << (e.receiver / haar_tile);
  out.resize(out.size() + tiles_bytes);
  std::memcpy(out.data() + out.size() - tiles_bytes, &tiles, tiles_bytes);
  for (size_t i = 0; i < entries.size();) {
    const size_t tile = entries[i].receiver / haar_tile;
    size_t end = i;
    while (end < entries.size() && entries[end].receiver / haar_tile == tile) ++end;
    if (end - i >= haar_whole) {
      uint8_t whole[haar_tile] = {};
      for (; i < end; ++i) whole[entries[i].receiver % haar_tile] = uint8_t(entries[i].value);
      out.push_back(0), out.insert(out.end(), std::begin(whole), std::end(whole));
      continue;
    }
    out.push_back(uint8_t(end - i));
    for (; i < end; ++i) out.push_back(entries[i].receiver % haar_tile), out.push_back(uint8_t(entries[i].value));
  }
}

// Of `receivers`: whether a column's tiles end where it does, and name no other receiver.
bool is_column(std::span<const uint8_t> column, size_t receivers) {
  if (column.size() <= tiles_bytes) return column.empty();
  size_t at = tiles_bytes;
  for (uint64_t tiles = tiles_of(column); tiles; tiles &= tiles - 1) {
    const size_t tile = size_t(std::countr_zero(tiles)) * haar_tile;
    if (tile >= receivers || at == column.size()) return false;
    const size_t count = column[at++], here = std::min(haar_tile, receivers - tile);
    if ((count ? 2 * count : haar_tile) > column.size() - at) return false;
    for (size_t i = 0; i < count; ++i)
      if (column[at + 2 * i] >= here || (i > 0 && column[at + 2 * i] <= column[at + 2 * i - 2])) return false;
    at += count ? 2 * count : haar_tile;
  }
  return at == column.size();
}

}  // namespace

size_t HaarTransfer::bytes() const {
  return steps.size() * sizeof(float) + starts.size() * sizeof(uint64_t) + begin.size() * sizeof(uint32_t) +
         data.size();
}

size_t HaarTransfer::entries() const {
  size_t sum = 0;
  for (size_t chunk = 0; chunk < chunks(); ++chunk)
    for (size_t c = 0; c < columns(); ++c) each_entry(column(chunk, c), [&](size_t, int) { ++sum; });
  return sum;
}

HaarWriter::HaarWriter(int size, std::span<const float> largest) {
  LAMBENT_CHECK(std::has_single_bit(unsigned(size)) && size >= 2 && size <= max_haar_size);
  out_.size = size;
  if (largest.size() > out_.light_columns()) out_.channels = 3;
  LAMBENT_CHECK(largest.size() == out_.columns());
  for (float v : largest) out_.steps.push_back(v / haar_steps);
}

void HaarWriter::add(std::span<const std::vector<HaarEntry>> rows) {
  LAMBENT_CHECK(rows.size() <= haar_chunk && out_.receivers % haar_chunk == 0);
  const size_t columns = out_.columns(), start = data_.size();
  const auto level = [&](const HaarEntry& e) {
    const float step = out_.steps[e.column];
    return step > 0 ? std::clamp(int(std::lround(e.value / step)), -haar_steps, haar_steps) : 0;
  };
  std::vector<uint32_t> count(columns + 1);
  for (const auto& row : rows)
    for (const HaarEntry& e : row) {
      const int value = level(e);
      count[e.column + 1] += value != 0;
      const double off = double(e.value) - double(value) * double(out_.steps[e.column]);
      lost_ += off * off;
    }
  for (size_t c = 0; c < columns; ++c) count[c + 1] += count[c];
  std::vector<PlacedValue> placed(count[columns]);
  std::vector<uint32_t> at(count.begin(), count.end() - 1);
  for (size_t r = 0; r < rows.size(); ++r)
    for (const HaarEntry& e : rows[r])
      if (const int value = level(e)) placed[at[e.column]++] = {uint16_t(r), int8_t(value)};
  out_.starts.push_back(start);
  for (size_t c = 0; c < columns; ++c) {
    out_.begin.push_back(uint32_t(data_.size() - start));
    if (count[c + 1] > count[c]) append_column({placed.data() + count[c], placed.data() + count[c + 1]}, data_);
  }
  out_.begin.push_back(uint32_t(data_.size() - start));
  out_.receivers += rows.size();
}

HaarTransfer HaarWriter::finish(double error) {
  out_.error = error, out_.starts.push_back(data_.size());
  auto owner = std::make_shared<const std::vector<uint8_t>>(std::move(data_));
  out_.data = *owner, out_.storage = std::move(owner);
  return std::move(out_);
}

HaarTransfer make_haar_transfer(int size, std::span<const std::vector<HaarEntry>> rows) {
  std::vector<float> largest(6 * size_t(size) * size_t(size));
  for (const auto& row : rows)
    for (const HaarEntry& e : row) largest[e.column] = std::max(largest[e.column], std::abs(e.value));
  HaarWriter writer(size, largest);
  for (size_t first = 0; first < rows.size(); first += haar_chunk)
    writer.add(rows.subspan(first, std::min(haar_chunk, rows.size() - first)));
  return writer.finish(0);
}

Result<void> check_haar(const HaarTransfer& t, const std::string& where) {
  if (t.size < 2 || t.size > max_haar_size || !std::has_single_bit(unsigned(t.size)))
    return Error{where, "the cube's side is no power of two from 2 to 256"};
  if (t.channels != 1 && t.channels != 3) return Error{where, "has neither one channel nor three"};
  const size_t columns = t.columns(), chunks = t.chunks();
  if (t.steps.size() != columns || t.starts.size() != chunks + 1 || t.begin.size() != chunks * (columns + 1))
    return Error{where, "has other numbers of columns than its cube"};
  for (float s : t.steps)
    if (!(s >= 0) || !std::isfinite(s)) return Error{where, "a column's step is no number from 0"};
  if (t.starts[0] != 0 || t.starts[chunks] != t.data.size() || !std::is_sorted(t.starts.begin(), t.starts.end()))
    return Error{where, "its columns do not fill their data"};
  for (size_t chunk = 0; chunk < chunks; ++chunk) {
    const uint32_t* at = t.begin.data() + chunk * (columns + 1);
    if (at[0] != 0 || at[columns] != t.starts[chunk + 1] - t.starts[chunk] || !std::is_sorted(at, at + columns + 1))
      return Error{where, "its columns do not follow one another to the end of their data"};
    const size_t count = std::min(haar_chunk, t.receivers - chunk * haar_chunk);
    for (size_t c = 0; c < columns; ++c)
      if (!is_column(t.column(chunk, c), count))
        return Error{where, "column " + std::to_string(c) +
                                " is not as long as its tiles say, or goes beyond the "
                                "receivers"};
  }
  return {};
}

std::vector<float> haar_column_norms(const HaarTransfer& t) {
  std::vector<int64_t> sums(t.columns());
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (size_t c = 0; c < t.columns(); ++c)
      each_entry(t.column(chunk, c), [&](size_t, int value) { sums[c] += value * value; });
  std::vector<float> norms(sums.size());
  for (size_t c = 0; c < sums.size(); ++c) norms[c] = float(std::sqrt(double(sums[c]))) * t.steps[c];
  return norms;
}

size_t load_columns(const HaarTransfer& t, size_t first, size_t count, size_t stride, size_t step, float* out) {
  size_t entries = 0;
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (size_t c = first; c < first + count; ++c) {
      float* at = out + chunk * haar_chunk * stride + (c - first) * step;
      each_entry(t.column(chunk, c),
                 [&](size_t r, int value) { at[r * stride] = float(value) * t.steps[c], ++entries; });
    }
  return entries;
}

std::vector<double> haar_squares(const HaarTransfer& t) {
  std::vector<double> squares(t.chunks() * haar_chunk);
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (size_t c = 0; c < t.columns(); ++c)
      each_entry(t.column(chunk, c), [&](size_t r, int value) {
        squares[chunk * haar_chunk + r] += double(value * value) * double(t.steps[c]) * double(t.steps[c]);
      });
  squares.resize(t.receivers);
  return squares;
}

std::vector<float> load_receiver(const HaarTransfer& t, size_t receiver) {
  std::vector<float> row(t.columns());
  for (size_t c = 0; c < row.size(); ++c)
    each_entry(t.column(receiver / haar_chunk, c), [&](size_t r, int value) {
      if (r == receiver % haar_chunk) row[c] = float(value) * t.steps[c];
    });
  return row;
}

}  // namespace lambent
