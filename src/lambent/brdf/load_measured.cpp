// W. Matusik et al., "A data-driven reflectance model", 2003 (MERL's file); Cornell Program of Computer Graphics,
// "Reflectance data" (text); R. Franke and G. Nielson, "Smooth interpolation of large sets of scattered data", 1980.
#include <lambent/brdf/load_measured.h>
#include <lambent/core/check.h>
#include <lambent/core/color.h>
#include <lambent/core/file.h>
#include <lambent/core/parallel.h>

#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>

namespace lambent {
namespace {

constexpr double most_reflectance = 1e9;  // per steradian: a mirror measured to a hundredth of a degree stays far below

// --- MERL

constexpr size_t header_bytes = 12;
constexpr uint32_t most_cells = 360;  // along each angle

// Cells that were not measured take the value of the nearest measured one at a smaller theta_d, else at a larger one;
// rows of which nothing was measured that of the row before, or of the first measured row after.
void fill_unmeasured(MeasuredTable& t, const std::vector<bool>& measured) {
  const size_t d_stride = size_t(t.phi_d), row = d_stride * size_t(t.theta_d);
  const size_t none = size_t(t.theta_h) * d_stride;
  size_t last_full = none,
         waiting = 0;  // columns (theta_h, phi_d) seen so far without any value wait for the first that has one
  auto column = [&](size_t c) { return c / d_stride * row + c % d_stride; };
  auto copy_column = [&](size_t to, size_t from) {
    for (size_t d = 0; d < size_t(t.theta_d); ++d) t.f[column(to) + d * d_stride] = t.f[column(from) + d * d_stride];
  };
  for (size_t c = 0; c < none; ++c) {
    size_t first = 0;
    while (first < size_t(t.theta_d) && !measured[column(c) + first * d_stride]) ++first;
    if (first == size_t(t.theta_d)) {
      if (last_full == none) ++waiting;
      else copy_column(c, last_full);
      continue;
    }
    Vec3 value = t.f[column(c) + first * d_stride];
    for (size_t d = 0; d < size_t(t.theta_d); ++d) {
      Vec3& f = t.f[column(c) + d * d_stride];
      if (measured[column(c) + d * d_stride]) value = f;
      else f = value;
    }
    for (; waiting > 0; --waiting) copy_column(c - waiting, c);
    last_full = c;
  }
}

Result<MeasuredTable> load_merl(std::span<const uint8_t> bytes, const std::string& where) {
  if (bytes.size() < header_bytes) return Error{where, "is cut short"};
  std::array<uint32_t, 3> counts;
  std::memcpy(counts.data(), bytes.data(), header_bytes);
  for (uint32_t n : counts)
    if (n < 1 || n > most_cells)
      return Error{where, "is not a MERL table: its counts of cells are not between 1 and 360"};
  const size_t cells = size_t(counts[0]) * counts[1] * counts[2], expected = header_bytes + cells * 3 * sizeof(double);
  if (bytes.size() != expected)
    return Error{where, "is " + std::to_string(bytes.size()) + " bytes long; a table of its counts of cells has " +
                            std::to_string(expected)};
  MeasuredTable t;
  t.theta_h = int(counts[0]), t.theta_d = int(counts[1]), t.phi_d = int(counts[2]), t.f.resize(cells);
  std::vector<bool> measured(cells, true);
  constexpr double scale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < cells; ++i) {
      double x;
      std::memcpy(&x, bytes.data() + header_bytes + (c * cells + i) * sizeof x, sizeof x);
      if (!std::isfinite(x))
        return Error{where, "number " + std::to_string(c * cells + i) + " of the table is not finite"};
      if (x * scale[c] > most_reflectance)
        return Error{where, "number " + std::to_string(c * cells + i) + " of the table is too large"};
      if (x < 0) measured[i] = false;
      t.f[i][int(c)] = float(std::max(x, 0.0) * scale[c]);
    }
  if (std::find(measured.begin(), measured.end(), true) == measured.end())
    return Error{where, "has no number that was measured"};
  fill_unmeasured(t, measured);
  return t;
}

// --- Cornell

// Numbers between blanks and comments, with the line that each is on.
class NumberReader {
 public:
  explicit NumberReader(std::span<const uint8_t> bytes)
      : p_(reinterpret_cast<const char*>(bytes.data())), end_(p_ + bytes.size()) {}

  enum class Read { number, end, wrong };
  Read next(double& x) {
    for (; p_ != end_; ++p_) {
      if (*p_ == '#') p_ = std::find(p_, end_, '\n');
      if (p_ == end_) break;
      if (*p_ == '\n') ++line_;
      else if (*p_ != ' ' && *p_ != '\t' && *p_ != '\r') break;
    }
    if (p_ == end_) return Read::end;
    auto [stop, status] = std::from_chars(p_, end_, x);
    if (status == std::errc::result_out_of_range)
      x = 0, status = std::errc();  // underflow, or found out of range below
    const bool ends = stop == end_ || *stop == ' ' || *stop == '\t' || *stop == '\r' || *stop == '\n' || *stop == '#';
    if (status != std::errc() || !ends) return Read::wrong;
    p_ = stop;
    return Read::number;
  }
  size_t line() const { return line_; }

 private:
  const char* p_;
  const char* end_;
  size_t line_ = 1;
};

constexpr size_t most_wavelengths = 1000, most_samples = 20000;

// What each wavelength of a flat reflectance of 1 adds to (1, 1, 1): trapezoids of illuminant times matching functions.
std::vector<Vec3d> rgb_weights(const std::vector<double>& nm) {
  std::vector<Vec3d> weights(nm.size());
  Vec3d white(0);
  for (size_t i = 0; i < nm.size(); ++i) {
    const double width = (nm[std::min(i + 1, nm.size() - 1)] - nm[i ? i - 1 : 0]) / 2;
    weights[i] = rec709_from_xyz(cie_matching_functions(nm[i]) * (illuminant_d65(nm[i]) * width));
    white += weights[i];
  }
  for (Vec3d& w : weights) w /= white;
  return weights;
}

// Below these the three colours cannot be told.
bool covers_visible_light(const std::vector<double>& nm) {
  for (size_t i = 0; i + 1 < nm.size(); ++i)
    if (nm[i] < 700 && nm[i + 1] - nm[i] > 40) return false;
  return nm.size() >= 3 && nm.front() <= 440 && nm.back() >= 640;
}

Result<MeasuredTable> load_cornell(std::span<const uint8_t> bytes, const std::string& where) {
  NumberReader reader(bytes);
  auto wrong = [&](const std::string& what) { return Error{where + ":" + std::to_string(reader.line()), what}; };
  double count = 0;
  if (reader.next(count) != NumberReader::Read::number)
    return Error{where, "is neither a MERL table nor text that begins with the number of wavelengths"};
  if (!(count >= 3 && count <= double(most_wavelengths)) || count != std::floor(count))
    return wrong("the number of wavelengths is not between 3 and 1000");
  std::vector<double> nm(size_t(count), 0.0);
  for (size_t i = 0; i < nm.size(); ++i) {
    if (reader.next(nm[i]) != NumberReader::Read::number) return wrong("expects a wavelength");
    if (!(nm[i] > (i ? nm[i - 1] : 0) && nm[i] < 1e5)) return wrong("the wavelengths do not rise");
  }
  if (!covers_visible_light(nm)) return wrong("the wavelengths do not cover 440 to 640 nm in steps of at most 40 nm");
  const std::vector<Vec3d> weights = rgb_weights(nm);

  std::vector<MeasuredSample> samples;
  std::vector<double> row(4 + nm.size());
  while (true) {
    for (size_t i = 0; i < row.size(); ++i) {
      const auto read = reader.next(row[i]);
      if (read == NumberReader::Read::end && i == 0) {
        if (samples.empty()) return Error{where, "has no measurements"};
        return resample_measured(samples, 64, 45, 36);
      }
      if (read == NumberReader::Read::end) return Error{where, "ends within a row of measurements"};
      if (read == NumberReader::Read::wrong) return wrong("expects a number");
      if (!std::isfinite(row[i])) return wrong("a number is not finite");
    }
    constexpr double steepest = std::numbers::pi / 2, turns = 8;  // some write angles beyond one turn
    for (int k : {0, 2})
      if (!(row[size_t(k)] >= 0 && row[size_t(k)] <= steepest)) return wrong("a theta is not between 0 and pi / 2");
    for (int k : {1, 3})
      if (!(std::abs(row[size_t(k)]) <= turns)) return wrong("a phi is not between -8 and 8");
    if (samples.size() == most_samples) return wrong("more than 20000 measurements");
    Vec3d rgb(0);
    for (size_t i = 0; i < nm.size(); ++i) {
      const double f = row[4 + i];
      if (f < 0) return wrong("a reflectance is negative");
      if (f > most_reflectance) return wrong("a reflectance is too large");
      rgb += f * weights[i];
    }
    auto direction = [](double theta, double phi) {
      return Vec3(Vec3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)));
    };
    const Vec3 wi = direction(row[0], row[1]), wo = direction(row[2], row[3]);
    if (length(wi + wo) < 1e-3f) continue;  // both level and opposite: no half vector
    samples.push_back({half_difference(wi, wo), Vec3(max(rgb, 0.0))});
  }
}

// --- Resampling

// Where a sample lies for the purpose of distances: lobes change fast with theta_h and slowly with theta_d; phi_d
// matters in so far as both others open, and its mirror image is the same.
Vec3 place(const HalfDifference& a) {
  constexpr float along_lobe = 4;
  return {along_lobe * std::sqrt(a.theta_h * (2 / pi)), a.theta_d * (2 / pi),
          std::sin(a.theta_h) * std::sin(a.theta_d) * std::cos(2 * a.phi_d)};
}

constexpr size_t neighbours = 10;

// The mean at x of the logarithms of the nearest samples.
Vec3 nearest_mean(std::span<const Vec3> places, std::span<const Vec3> logarithms, Vec3 x) {
  std::array<std::pair<float, size_t>, neighbours + 1> best;  // squared distances, rising
  size_t count = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    const Vec3 to = places[i] - x;
    const float d2 = dot(to, to);
    if (count == best.size() && !(d2 < best[count - 1].first)) continue;
    size_t at = count < best.size() ? count++ : count - 1;
    for (; at > 0 && d2 < best[at - 1].first; --at) best[at] = best[at - 1];
    best[at] = {d2, i};
  }
  // With no more samples than neighbours, all count.
  const bool few = count <= neighbours;
  const float radius = few ? 2 * std::sqrt(best[count - 1].first) + 1 : std::sqrt(best[count - 1].first);
  Vec3d sum(0);
  double total = 0;
  for (size_t k = 0; k < (few ? count : count - 1); ++k) {
    const float distance = std::max(std::sqrt(best[k].first), 1e-6f * radius);
    const double w = std::pow(double(std::max(radius - distance, 0.0f)) / (double(radius) * distance), 2);
    sum += w * Vec3d(logarithms[best[k].second]), total += w;
  }
  if (!(total > 0)) return logarithms[best[0].second];  // all at one distance
  return Vec3(sum / total);
}

}  // namespace

MeasuredTable resample_measured(std::span<const MeasuredSample> samples, int theta_h, int theta_d, int phi_d) {
  LAMBENT_CHECK(!samples.empty() && theta_h >= 1 && theta_d >= 1 && phi_d >= 1);
  constexpr float darkest = 1e-5f;  // what logarithms take 0 for
  std::vector<Vec3> places, logarithms;
  for (const MeasuredSample& s : samples)
    places.push_back(place(s.angles)), logarithms.push_back(log(max(s.f, Vec3(darkest))));
  MeasuredTable t;
  t.theta_h = theta_h, t.theta_d = theta_d, t.phi_d = phi_d;
  t.f.resize(size_t(theta_h) * size_t(theta_d) * size_t(phi_d));
  parallel_for(size_t(theta_h), 1, [&](size_t begin, size_t end) {
    for (int h = int(begin); h < int(end); ++h)
      for (int d = 0; d < theta_d; ++d)
        for (int p = 0; p < (phi_d + 1) / 2; ++p) {
          const Vec3 f = exp(nearest_mean(places, logarithms, place(cell_angles(t, h, d, p))));
          t.f[t.index(h, d, p)] = t.f[t.index(h, d, phi_d - 1 - p)] = f;
        }
  });
  prepare_sampling(t);
  return t;
}

Result<MeasuredTable> load_measured(std::span<const uint8_t> bytes, const std::string& where) {
  if (bytes.empty()) return Error{where, "is empty"};
  const auto head = bytes.first(std::min(bytes.size(), header_bytes));
  const bool binary = std::find(head.begin(), head.end(), uint8_t{0}) !=
                      head.end();  // counts below 2^24 have a zero byte
  auto table = binary ? load_merl(bytes, where) : load_cornell(bytes, where);
  if (!table) return table;
  table->name = std::filesystem::path(where).stem().string();
  if (binary) prepare_sampling(*table);
  return table;
}

Result<MeasuredTable> load_measured(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return load_measured(file->bytes(), path);
}

}  // namespace lambent
