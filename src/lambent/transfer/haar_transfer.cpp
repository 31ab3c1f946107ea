#include <lambent/transfer/haar_transfer.h>

#include <lambent/core/check.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace lambent {
namespace {

constexpr int haar_steps = 127;
constexpr int max_haar_size = 256;

void append_entry(std::vector<uint8_t>& out, size_t from, size_t to, int value) {
  size_t step = to - from;
  for (; step > 255; step -= 255) out.push_back(255), out.push_back(0);
  out.push_back(uint8_t(step)), out.push_back(uint8_t(int8_t(value)));
}

}  // namespace

size_t HaarTransfer::bytes() const {
  size_t sum = steps.size() * sizeof(float) + begin.size() * sizeof(uint32_t);
  for (const auto& chunk : data) sum += chunk.size();
  return sum;
}

size_t HaarTransfer::entries() const {
  size_t sum = 0;
  for (const auto& chunk : data)
    for (size_t i = 1; i < chunk.size(); i += 2) sum += chunk[i] != 0;
  return sum;
}

HaarTransfer make_haar_transfer(int size, std::span<const std::vector<HaarEntry>> rows) {
  LAMBENT_CHECK(std::has_single_bit(unsigned(size)) && size >= 2 && size <= max_haar_size);
  HaarTransfer out{size, rows.size(), {}, {}, {}};
  const size_t columns = out.columns();
  out.steps.assign(columns, 0.0f);
  for (const auto& row : rows)
    for (const HaarEntry& e : row) out.steps[e.column] = std::max(out.steps[e.column], std::abs(e.value));
  for (float& s : out.steps) s /= haar_steps;
  struct Placed {
    uint16_t receiver;
    int8_t value;
  };
  std::vector<uint32_t> count(columns + 1);
  std::vector<Placed> placed;
  for (size_t chunk = 0; chunk < out.chunks(); ++chunk) {
    const auto here = rows.subspan(chunk * haar_chunk, std::min(haar_chunk, rows.size() - chunk * haar_chunk));
    std::fill(count.begin(), count.end(), 0u);
    const auto level = [&](const HaarEntry& e) {
      return out.steps[e.column] > 0 ? int(std::lround(e.value / out.steps[e.column])) : 0;
    };
    for (const auto& row : here)
      for (const HaarEntry& e : row) count[e.column + 1] += level(e) != 0;
    for (size_t c = 0; c < columns; ++c) count[c + 1] += count[c];
    placed.resize(count[columns]);
    std::vector<uint32_t> at(count.begin(), count.end() - 1);
    for (size_t r = 0; r < here.size(); ++r)
      for (const HaarEntry& e : here[r])
        if (const int value = level(e)) placed[at[e.column]++] = {uint16_t(r), int8_t(value)};
    std::vector<uint8_t>& data = out.data.emplace_back();
    for (size_t c = 0; c < columns; ++c) {
      out.begin.push_back(uint32_t(data.size()));
      size_t last = 0;  // one before the first is 0, so that a step is a byte from 1
      for (uint32_t i = count[c]; i < count[c + 1]; ++i) {
        append_entry(data, last, placed[i].receiver + 1u, placed[i].value);
        last = placed[i].receiver + 1u;
      }
    }
    out.begin.push_back(uint32_t(data.size()));
  }
  return out;
}

Result<void> check_haar(const HaarTransfer& t, const std::string& where) {
  if (t.size < 2 || t.size > max_haar_size || !std::has_single_bit(unsigned(t.size)))
    return Error{where, "the cube's side is no power of two from 2 to 256"};
  const size_t columns = t.columns();
  if (t.steps.size() != columns || t.data.size() != t.chunks() || t.begin.size() != t.chunks() * (columns + 1))
    return Error{where, "has other numbers of columns than its cube"};
  for (float s : t.steps)
    if (!(s >= 0) || !std::isfinite(s)) return Error{where, "a column's step is no number from 0"};
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk) {
    const uint32_t* at = t.begin.data() + chunk * (columns + 1);
    if (at[0] != 0 || at[columns] != t.data[chunk].size() || !std::is_sorted(at, at + columns + 1))
      return Error{where, "its columns do not follow one another to the end of their data"};
    const size_t count = std::min(haar_chunk, t.receivers - chunk * haar_chunk);
    for (size_t c = 0; c < columns; ++c) {
      const std::span<const uint8_t> bytes = t.column(chunk, c);
      if (bytes.size() % 2) return Error{where, "a column ends within a pair"};
      size_t reached = 0;
      for (size_t i = 0; i < bytes.size(); i += 2) {
        reached += bytes[i];
        if (bytes[i] == 0 || reached > count || bytes[i + 1] == 128)
          return Error{where, "a column goes beyond the receivers, or stays where it was"};
      }
    }
  }
  return {};
}

std::vector<float> haar_column_norms(const HaarTransfer& t) {
  std::vector<double> sums(t.columns());
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (size_t c = 0; c < t.columns(); ++c) {
      const std::span<const uint8_t> bytes = t.column(chunk, c);
      for (size_t i = 1; i < bytes.size(); i += 2) sums[c] += double(int8_t(bytes[i])) * double(int8_t(bytes[i]));
    }
  std::vector<float> norms(sums.size());
  for (size_t c = 0; c < sums.size(); ++c) norms[c] = float(std::sqrt(sums[c])) * t.steps[c];
  return norms;
}

}  // namespace lambent
