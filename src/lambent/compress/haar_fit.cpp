#include <lambent/compress/haar_fit.h>
#include <lambent/compress/haar_rows.h>

#include <lambent/basis/haar.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

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

}  // namespace

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

Result<std::vector<std::vector<HaarEntry>>> haar_rows(const Visibility& v, std::span<const Vec3> normals,
                                                      const HaarFitOptions& o, Progress* progress) {
  if (auto ok = check_fit(v, normals, o); !ok) return ok.error();
  const Cube cube = make_cube(v.size);
  ProgressStage stage(progress, "wavelets", v.receivers);
  std::vector<std::vector<HaarEntry>> rows(v.receivers);
  parallel_for(v.receivers, 16, [&](size_t begin, size_t end) {
    thread_local HaarScratchRow scratch;
    for (size_t r = begin; r < end && !stage.cancelled(); ++r) {
      transform_row(v, cube, r, normals[r], scratch);
      rows[r] = largest_of(scratch.row, o);
    }
    stage.advance(end - begin);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return rows;
}

HaarTransfer store_haar_rows(int size, int channels, std::span<const std::vector<HaarEntry>> rows, double all,
                             double left, HaarFitReport* report) {
  std::vector<float> largest(size_t(channels) * cube_texels(size));
  size_t entries = 0;
  for (const auto& row : rows) {
    entries += row.size();
    for (const HaarEntry& e : row) largest[e.column] = std::max(largest[e.column], std::abs(e.value));
  }
  HaarWriter writer(size, largest);
  for (size_t first = 0; first < rows.size(); first += haar_chunk)
    writer.add(rows.subspan(first, std::min(haar_chunk, rows.size() - first)));
  const double error = all > 0 ? std::sqrt((left + writer.lost()) / all) : 0.0;
  if (report) *report = {error, double(entries) / double(std::max<size_t>(rows.size(), 1))};
  return writer.finish(error);
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
