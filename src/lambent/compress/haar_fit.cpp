#include <lambent/compress/haar_fit.h>
#include <lambent/compress/haar_rows.h>

#include <lambent/basis/haar.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>
#include <numbers>
#include <optional>

namespace lambent {
namespace {

struct HaarScratchRow {
  std::vector<uint8_t> levels;
  std::vector<float> face, row;
  HaarTree tree;
};

void transform_row(const Visibility& v, const Cube& cube, size_t receiver, Vec3 n, HaarScratchRow& s) {
  const int size = v.size;
  const size_t area = size_t(size) * size_t(size);
  s.levels.resize(cube.count()), s.face.resize(area), s.row.resize(6 * area);
  decode_visibility(v, receiver, s.levels);
  const float scale = 1 / (float(std::numbers::pi) * float(v.top()));
  for (int f = 0; f < 6; ++f) {
    bool any = false;
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        const size_t t = cube_texel(size, f, column, row);
        const float value = s.levels[t] ? float(s.levels[t]) * scale * std::max(0.0f, dot(n, cube.texels.at(t))) : 0.0f;
        s.face[size_t(row) * size_t(size) + size_t(column)] = value, any |= value != 0;
      }
    const auto out = s.row.begin() + ptrdiff_t(size_t(f) * area);
    if (!any) {
      std::fill_n(out, area, 0.0f);
      continue;
    }
    haar_transform(std::countr_zero(unsigned(size)), s.face, s.tree);
    std::copy(s.tree.coefficients.begin(), s.tree.coefficients.end(), out);
  }
}

// What the options leave of a row of `columns`, which has its entries by rising column.
std::vector<HaarEntry> largest_entries(std::span<const HaarEntry> row, const HaarFitOptions& o, size_t columns) {
  std::vector<HaarEntry> out(row.begin(), row.end());
  std::sort(out.begin(), out.end(), [&](const HaarEntry& a, const HaarEntry& b) {
    const float x = std::abs(a.value), y = std::abs(b.value);
    return x != y ? x > y : a.column < b.column;
  });
  size_t keep = out.size();
  if (o.keep > 0) {
    keep = std::min(keep, size_t(std::ceil(o.keep * double(columns))));
  } else {
    double all = 0, left = 0;
    for (const HaarEntry& e : row) all += double(e.value) * double(e.value);
    const double allowed = o.error * o.error * all;
    while (keep > 0) {
      const double square = double(out[keep - 1].value) * double(out[keep - 1].value);
      if (left + square > allowed) break;
      left += square, --keep;
    }
  }
  out.resize(keep);
  std::sort(out.begin(), out.end(), [](const HaarEntry& a, const HaarEntry& b) { return a.column < b.column; });
  return out;
}

std::vector<HaarEntry> largest_of(const std::vector<float>& row, const HaarFitOptions& o) {
  std::vector<HaarEntry> entries;
  for (uint32_t c = 0; c < row.size(); ++c)
    if (row[c] != 0) entries.push_back({c, row[c]});
  return largest_entries(entries, o, row.size());
}

Result<void> check_fit(const Visibility& v, std::span<const Vec3> normals, const HaarFitOptions& o) {
  if (!std::has_single_bit(unsigned(v.size))) return Error{"", "Haar wavelets want a cube of 2^k texels a side"};
  if (normals.size() != v.receivers) return Error{"", "there is not a normal for each receiver"};
  if (!(o.keep >= 0 && o.keep <= 1) || !(o.error >= 0 && o.error < 1))
    return Error{"", "the share or the error of Haar coefficients is out of range"};
  return {};
}

using HaarRows = std::vector<std::vector<HaarEntry>>;

// What of a row may be left out one by one, so that all of it is an eighth of what the options leave out.
std::vector<float> least_entries(const HaarColumnsMaker& m, const HaarFitOptions& o) {
  double mean = 0;
  for (double s : m.squares) mean += s / double(m.rows);
  const double error = o.keep > 0 ? 1e-3 : o.error, columns = double(size_t(m.channels) * cube_texels(m.size));
  std::vector<float> least;
  for (double s : m.squares) least.push_back(float(error * std::sqrt(std::max(s, 1e-3 * mean) / (8 * columns))));
  return least;
}

// Rows [first, first + rows.size()) on their way.
struct HaarPass {
  size_t first = 0;
  HaarRows rows;
  std::vector<double> all, left;  // sums of squares, by row: of all of it, and of what is not in `rows`

  size_t bytes() const {
    size_t sum = 0;
    for (const auto& row : rows) sum += row.capacity() * sizeof(HaarEntry);
    return sum;
  }
  // The last rows are dropped, for a pass of their own.
  void shed(size_t memory) {
    while (rows.size() > haar_chunk && bytes() > memory)
      rows.resize(std::max<size_t>(rows.size() / 2 / haar_chunk, 1) * haar_chunk);
  }
};

// largest: of each column, what no entry exceeds; set by the first pass, which looks at all rows.
Result<void> run_pass(const HaarColumnsMaker& m, const HaarFitOptions& o, std::span<const float> least, size_t memory,
                      ProgressStage& stage, HaarPass& pass, std::vector<float>& largest) {
  const size_t columns = cube_texels(m.size), channels = size_t(m.channels), stride = m.together * channels;
  std::mutex mutex;
  for (size_t first = 0; first < columns && !stage.cancelled(); first += m.together) {
    const size_t count = std::min(m.together, columns - first);
    auto made = m.make(first, count);
    if (!made) return made.error();
    stage.advance(count);
    if (made->empty()) continue;
    parallel_for(pass.first ? pass.rows.size() : m.rows, 64, [&](size_t begin, size_t end) {
      std::vector<float> most(count * channels);
      for (size_t i = begin; i < end; ++i) {
        const size_t r = pass.first + i;
        const float* values = made->data() + r * stride;
        for (size_t k = 0; k < count; ++k)
          for (size_t c = 0; c < channels; ++c) {
            const float value = values[k * channels + c];
            const bool kept = std::abs(value) > least[r];
            if (kept) most[c * count + k] = std::max(most[c * count + k], std::abs(value));
            if (i >= pass.rows.size()) continue;
            const double square = double(value) * double(value);
            pass.all[i] += square;
            if (kept) pass.rows[i].push_back({uint32_t(c * columns + first + k), value});
            else pass.left[i] += square;
          }
      }
      if (pass.first) return;
      const std::lock_guard lock(mutex);
      for (size_t c = 0; c < channels; ++c)
        for (size_t k = 0; k < count; ++k) {
          float& l = largest[c * columns + first + k];
          l = std::max(l, most[c * count + k]);
        }
    });
    pass.shed(memory);
  }
  if (stage.cancelled()) return Error{"", "cancelled"};
  parallel_for(pass.rows.size(), 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::vector<HaarEntry>& row = pass.rows[i];
      std::sort(row.begin(), row.end(), [](const HaarEntry& a, const HaarEntry& b) { return a.column < b.column; });
      std::vector<HaarEntry> kept = largest_entries(row, o, channels * columns);
      for (const HaarEntry& e : row) pass.left[i] += double(e.value) * double(e.value);
      for (const HaarEntry& e : kept) pass.left[i] -= double(e.value) * double(e.value);
      row = std::move(kept);
    }
  });
  return {};
}

}  // namespace

Result<HaarTransfer> store_haar_columns(const HaarColumnsMaker& m, const HaarFitOptions& o, size_t memory,
                                        HaarFitReport* report, Progress* progress, const std::string& name,
                                        int* passes) {
  LAMBENT_CHECK(m.squares.size() == m.rows && m.together > 0);
  const std::vector<float> least = least_entries(m, o);
  std::vector<float> largest(size_t(m.channels) * cube_texels(m.size));
  std::optional<HaarWriter> writer;
  double all = 0, left = 0;
  size_t entries = 0;
  int count = 0;
  for (size_t first = 0; first < m.rows; ++count) {
    HaarPass pass{first, HaarRows(m.rows - first), std::vector<double>(m.rows - first),
                  std::vector<double>(m.rows - first)};
    ProgressStage stage(progress, name, cube_texels(m.size));
    if (auto ok = run_pass(m, o, least, memory, stage, pass, largest); !ok) return ok.error();
    if (!writer) writer.emplace(m.size, largest);
    const std::span<const std::vector<HaarEntry>> rows = pass.rows;
    for (size_t r = 0; r < rows.size(); r += haar_chunk)
      writer->add(rows.subspan(r, std::min(haar_chunk, rows.size() - r)));
    for (size_t r = 0; r < rows.size(); ++r)
      all += pass.all[r], left += std::max(pass.left[r], 0.0), entries += rows[r].size();
    first += rows.size();
  }
  if (!writer) writer.emplace(m.size, largest);
  const double lost = all > 0 ? (left + writer->lost()) / all : 0.0, error = std::sqrt(lost + m.error * m.error);
  if (report) *report = {error, double(entries) / double(std::max<size_t>(m.rows, 1))};
  if (passes) *passes = count;
  return writer->finish(error);
}

std::vector<float> haar_row(const Visibility& v, size_t receiver, Vec3 normal) {
  HaarScratchRow s;
  transform_row(v, make_cube(v.size), receiver, normal, s);
  return s.row;
}

Result<HaarTransfer> fit_haar(const Visibility& v, std::span<const Vec3> normals, const HaarFitOptions& o,
                              HaarFitReport* report, Progress* progress) {
  if (auto ok = check_fit(v, normals, o); !ok) return ok.error();
  const Cube cube = make_cube(v.size);
  ProgressStage stage(progress, "wavelets", 2 * v.receivers);
  // Twice over all: the columns' steps first, then the chunks, of which one is in memory at a time.
  std::vector<float> largest(cube.count());
  double all = 0, left = 0;
  std::vector<std::vector<HaarEntry>> rows;
  std::vector<double> squares, dropped;
  const auto make_rows = [&](size_t first, size_t count) {
    rows.assign(count, {}), squares.assign(count, 0), dropped.assign(count, 0);
    parallel_for(count, 16, [&](size_t begin, size_t end) {
      thread_local HaarScratchRow scratch;
      for (size_t r = begin; r < end && !stage.cancelled(); ++r) {
        transform_row(v, cube, first + r, normals[first + r], scratch);
        rows[r] = largest_of(scratch.row, o);
        for (float c : scratch.row) squares[r] += double(c) * double(c);
        dropped[r] = squares[r];
        for (const HaarEntry& e : rows[r]) dropped[r] -= double(e.value) * double(e.value);
      }
      stage.advance(end - begin);
    });
  };
  size_t entries = 0;
  for (size_t first = 0; first < v.receivers && !stage.cancelled(); first += haar_chunk) {
    make_rows(first, std::min(haar_chunk, v.receivers - first));
    for (size_t r = 0; r < rows.size(); ++r) {
      all += squares[r], left += std::max(dropped[r], 0.0), entries += rows[r].size();
      for (const HaarEntry& e : rows[r]) largest[e.column] = std::max(largest[e.column], std::abs(e.value));
    }
  }
  HaarWriter writer(v.size, largest);
  for (size_t first = 0; first < v.receivers && !stage.cancelled(); first += haar_chunk) {
    if (v.receivers > haar_chunk) make_rows(first, std::min(haar_chunk, v.receivers - first));
    writer.add(rows);
  }
  if (stage.cancelled()) return Error{"", "cancelled"};
  const double error = all > 0 ? std::sqrt((left + writer.lost()) / all) : 0.0;
  if (report) *report = {error, double(entries) / double(std::max<size_t>(v.receivers, 1))};
  return writer.finish(error);
}

}  // namespace lambent
