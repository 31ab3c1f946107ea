#include <lambent/compress/haar_fit.h>

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

// The largest coefficients of a row, by rising column.
std::vector<HaarEntry> largest_of(const std::vector<float>& row, const HaarFitOptions& o) {
  std::vector<uint32_t> order;
  double all = 0;
  for (uint32_t c = 0; c < row.size(); ++c)
    if (row[c] != 0) order.push_back(c), all += double(row[c]) * double(row[c]);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const float x = std::abs(row[a]), y = std::abs(row[b]);
    return x != y ? x > y : a < b;
  });
  size_t keep = order.size();
  if (o.keep > 0) {
    keep = std::min(keep, size_t(std::ceil(o.keep * double(row.size()))));
  } else {
    double left = 0;
    const double allowed = o.error * o.error * all;
    while (keep > 0) {
      const double square = double(row[order[keep - 1]]) * double(row[order[keep - 1]]);
      if (left + square > allowed) break;
      left += square, --keep;
    }
  }
  order.resize(keep);
  std::sort(order.begin(), order.end());
  std::vector<HaarEntry> out;
  for (uint32_t c : order) out.push_back({c, row[c]});
  return out;
}

}  // namespace

std::vector<float> haar_row(const Visibility& v, size_t receiver, Vec3 normal) {
  HaarScratchRow s;
  transform_row(v, make_cube(v.size), receiver, normal, s);
  return s.row;
}

Result<HaarTransfer> fit_haar(const Visibility& v, std::span<const Vec3> normals, const HaarFitOptions& o,
                              HaarFitReport* report, Progress* progress) {
  if (!std::has_single_bit(unsigned(v.size))) return Error{"", "Haar wavelets want a cube of 2^k texels a side"};
  if (normals.size() != v.receivers) return Error{"", "there is not a normal for each receiver"};
  if (!(o.keep >= 0 && o.keep <= 1) || !(o.error >= 0 && o.error < 1))
    return Error{"", "the share or the error of Haar coefficients is out of range"};
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
