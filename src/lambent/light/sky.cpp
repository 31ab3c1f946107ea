// Preetham, Shirley and Smits 1999, "A practical analytic model for daylight": the sky's distribution (appendix A.2) in
// the form of Perez et al. 1993, the sun's attenuation (appendix A.1) with Iqbal's absorption data. Relative air mass:
// Kasten 1966.
#include <lambent/core/color.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>
#include <lambent/light/sky.h>

#include <array>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;
constexpr double sun_radius = 0.5 * 0.533 * pi_d / 180;  // angular, radians
constexpr double unit = 10000;                           // cd/m^2

double in_radians(double degrees) { return degrees * pi_d / 180; }

// --- The sun

struct SpectrumRow {
  double radiance;     // of the sun outside the atmosphere, W / (cm^2 um sr)
  double ozone;        // absorption k_o, 1 / cm
  double water;        // absorption k_wa, 1 / cm
  double mixed_gases;  // absorption k_g, effective
};
constexpr double first_wavelength = 380, wavelength_step = 10;  // nm
// The last three radiances continue the table as a black body of 5778 K.
constexpr SpectrumRow spectrum[] = {
    {1655, 0, 0, 0},         {1623, 0, 0, 0},          {2112, 0, 0, 0},          {2588, 0, 0, 0},
    {2582, 0, 0, 0},         {2423, 0, 0, 0},          {2676, 0, 0, 0},          {2966, 0.003, 0, 0},
    {3054, 0.006, 0, 0},     {3006, 0.009, 0, 0},      {3066, 0.014, 0, 0},      {2883, 0.021, 0, 0},
    {2871, 0.030, 0, 0},     {2782, 0.040, 0, 0},      {2710, 0.048, 0, 0},      {2723, 0.063, 0, 0},
    {2636, 0.075, 0, 0},     {2550, 0.085, 0, 0},      {2506, 0.103, 0, 0},      {2531, 0.120, 0, 0},
    {2535, 0.120, 0, 0},     {2513, 0.115, 0, 0},      {2463, 0.125, 0, 0},      {2417, 0.120, 0, 0},
    {2368, 0.105, 0, 0},     {2321, 0.090, 0, 0},      {2282, 0.079, 0, 0},      {2234, 0.067, 0, 0},
    {2197, 0.057, 0, 0},     {2153, 0.048, 0, 0},      {2110, 0.036, 0, 0},      {2073, 0.028, 0.016, 0},
    {2024, 0.023, 0.024, 0}, {1987, 0.018, 0.0125, 0}, {1943, 0.014, 1.0, 0},    {1907, 0.011, 0.87, 0},
    {1863, 0.010, 0.061, 0}, {1826, 0.009, 0.001, 0},  {1788, 0.007, 1e-5, 3.0}, {1751, 0.004, 1e-5, 0.21},
    {1714, 0, 6e-4, 0}};

// Transmittance of the atmosphere, appendix A.1, for relative air mass m.
double transmittance(const SpectrumRow& row, double um, double m, double turbidity) {
  constexpr double ozone_cm = 0.35, water_cm = 2, angstrom_exponent = 1.3;
  double beta = 0.04608 * turbidity - 0.04586;
  double rayleigh = std::exp(-0.008735 * std::pow(um, -4.08) * m);
  double aerosol = std::exp(-beta * std::pow(um, -angstrom_exponent) * m);
  double ozone = std::exp(-row.ozone * ozone_cm * m);
  double gases = std::exp(-1.41 * row.mixed_gases * m / std::pow(1 + 118.93 * row.mixed_gases * m, 0.45));
  double water = std::exp(-0.2385 * row.water * water_cm * m / std::pow(1 + 20.07 * row.water * water_cm * m, 0.45));
  return rayleigh * aerosol * ozone * gases * water;
}

double air_mass(double elevation) {
  double zenith = std::min(90 - elevation, 90.0);
  return 1 / (std::cos(in_radians(zenith)) + 0.15 * std::pow(93.885 - zenith, -1.253));
}

// --- The sky

using Quintet = std::array<double, 5>;
struct SkyModel {
  Quintet perez_Y, perez_x, perez_y;
  double scale_Y, scale_x, scale_y;  // value at the zenith, cd/m^2 and chromaticity, over the distribution there
};

double perez(const Quintet& c, double theta, double gamma) {
  double cos_theta = std::max(std::cos(theta), 1e-4), cos_gamma = std::cos(gamma);
  return (1 + c[0] * std::exp(c[1] / cos_theta)) * (1 + c[2] * std::exp(c[3] * gamma) + c[4] * cos_gamma * cos_gamma);
}

SkyModel make_model(double elevation, double turbidity) {
  double T = std::max(turbidity, 2.0);
  SkyModel m;
  const double theta_s = in_radians(90 - std::max(elevation, 0.0));
  m.perez_Y = {0.1787 * T - 1.4630, -0.3554 * T + 0.4275, -0.0227 * T + 5.3251, 0.1206 * T - 2.5771,
               -0.0670 * T + 0.3703};
  m.perez_x = {-0.0193 * T - 0.2592, -0.0665 * T + 0.0008, -0.0004 * T + 0.2125, -0.0641 * T - 0.8989,
               -0.0033 * T + 0.0452};
  m.perez_y = {-0.0167 * T - 0.2608, -0.0950 * T + 0.0092, -0.0079 * T + 0.2102, -0.0441 * T - 1.6537,
               -0.0109 * T + 0.0529};
  double chi = (4.0 / 9 - T / 120) * (pi_d - 2 * theta_s);
  double zenith_Y = std::max(0.0, 1000 * ((4.0453 * T - 4.9710) * std::tan(chi) - 0.2155 * T + 2.4192));
  zenith_Y *= std::exp(std::min(elevation, 0.0) / 1.5);
  auto zenith = [&](const double(&rows)[3][4]) {
    double t = theta_s, sum = 0, power = T * T;
    for (const auto& r : rows) sum += power * (((r[0] * t + r[1]) * t + r[2]) * t + r[3]), power /= T;
    return sum;
  };
  double zenith_x = zenith(
      {{0.00166, -0.00375, 0.00209, 0}, {-0.02903, 0.06377, -0.03202, 0.00394}, {0.11693, -0.21196, 0.06052, 0.25886}});
  double zenith_y = zenith(
      {{0.00275, -0.00610, 0.00317, 0}, {-0.04214, 0.08970, -0.04153, 0.00516}, {0.15346, -0.26756, 0.06670, 0.26688}});
  m.scale_Y = zenith_Y / perez(m.perez_Y, 0, theta_s);
  m.scale_x = zenith_x / perez(m.perez_x, 0, theta_s);
  m.scale_y = zenith_y / perez(m.perez_y, 0, theta_s);
  return m;
}

Vec3 sky_radiance(const SkyModel& m, Vec3 d, Vec3d sun) {
  double theta = std::acos(std::clamp(double(d.y), 0.0, 1.0)),
         gamma = std::acos(std::clamp(dot(Vec3d(d), sun), -1.0, 1.0));
  double Y = std::max(0.0, m.scale_Y * perez(m.perez_Y, theta, gamma)) / unit;
  double x = std::clamp(m.scale_x * perez(m.perez_x, theta, gamma), 0.05, 0.7);
  double y = std::clamp(m.scale_y * perez(m.perez_y, theta, gamma), 0.05, 0.7);
  return Vec3(max(rec709_from_xyz({x / y * Y, Y, (1 - x - y) / y * Y}), Vec3d(0)));
}

// Deposits the disc: points of equal solid angle each give their share of the irradiance to the texel they fall in.
void add_sun(Image& image, Vec3d sun, Vec3 irradiance) {
  const int side =
      std::clamp(image.width / 4, 64, 1024);  // several points in each texel, also in the thin ones at the zenith
  Vec3d aside = normalize(std::abs(sun.y) < 0.9 ? cross(sun, Vec3d(0, 1, 0)) : cross(sun, Vec3d(1, 0, 0)));
  Vec3d up = cross(aside, sun);
  std::vector<int> points(image.rgb.size());
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      Vec2d p(square_to_disk({(float(i) + 0.5f) / float(side), (float(j) + 0.5f) / float(side)}));
      double r = length(p),
             angle = 2 * std::asin(r * std::sin(sun_radius / 2));  // equal areas of the disc and the cap
      Vec2d around = p / r;                                        // never 0: points lie off the centre
      Vec3d d = std::cos(angle) * sun + std::sin(angle) * (around.x * aside + around.y * up);
      if (d.y <= 0) continue;
      Vec2 uv = latlong_uv(Vec3(d));
      int x = std::min(int(uv.x * float(image.width)), image.width - 1);
      int y = std::min(int(uv.y * float(image.height)), image.height / 2 - 1);  // not below the horizon by rounding
      ++points[size_t(y) * size_t(image.width) + size_t(x)];
    }
  for (size_t i = 0; i < points.size(); ++i)
    if (points[i] > 0) {
      double solid_angle = texel_solid_angle(int(i / size_t(image.width)), image.width, image.height);
      image.rgb[i] += Vec3(Vec3d(irradiance) * (double(points[i]) / (double(side) * side) / solid_angle));
    }
}

}  // namespace

Vec3 sun_irradiance(float elevation, float turbidity) {
  const double solid_angle = 2 * pi_d * (1 - std::cos(sun_radius));
  constexpr double lumens_a_watt = 683, radiance_si = 1e4 * 1e-3;  // W / (cm^2 um) to W / (m^2 nm)
  double m = air_mass(double(elevation));
  Vec3d xyz(0);
  double nm = first_wavelength;
  for (const SpectrumRow& row : spectrum) {
    xyz += cie_matching_functions(nm) * (row.radiance * transmittance(row, nm / 1000, m, double(turbidity)));
    nm += wavelength_step;
  }
  xyz *= wavelength_step * radiance_si * solid_angle * lumens_a_watt / unit;
  return Vec3(max(rec709_from_xyz(xyz), Vec3d(0)));
}

Result<Environment> make_sky(const SkyOptions& o) {
  // Comparisons are written so that NaN fails them.
  if (!(o.elevation >= -2 && o.elevation <= 90)) return Error{"sky", "elevation must lie in [-2, 90] degrees"};
  if (!std::isfinite(o.azimuth)) return Error{"sky", "azimuth must be a number of degrees"};
  if (!(o.turbidity >= 1.7f && o.turbidity <= 10)) return Error{"sky", "turbidity must lie in [1.7, 10]"};
  for (int k = 0; k < 3; ++k)
    if (!(o.ground[k] >= 0 && o.ground[k] <= 1)) return Error{"sky", "ground must lie in [0, 1]"};
  if (o.width < 8 || o.width > 16384 || o.width % 2) return Error{"sky", "width must be even and lie in [8, 16384]"};

  double e = in_radians(double(o.elevation)), a = in_radians(std::fmod(double(o.azimuth), 360.0));
  Vec3d sun(std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a));
  // A sun below the horizon leaves the sky that of one on it.
  double seen = std::max(e, 0.0);
  Vec3d sun_of_sky(std::cos(seen) * std::cos(a), std::sin(seen), std::cos(seen) * std::sin(a));
  SkyModel model = make_model(double(o.elevation), double(o.turbidity));
  Environment env;
  env.name = "sky", env.image = Image(o.width, o.width / 2);
  const int horizon = env.image.height / 2;  // the first row whose centre is not above it
  parallel_for(size_t(horizon), 4, [&](size_t begin, size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < o.width; ++x)
        env.image.at(x, y) = sky_radiance(model, texel_direction(x, y, o.width, env.image.height), sun_of_sky);
  });
  if (o.sun) add_sun(env.image, sun, sun_irradiance(o.elevation, o.turbidity));
  Vec3 ground = o.ground * irradiance(env, Vec3(0, 1, 0)) / pi;
  std::fill(env.image.rgb.begin() + ptrdiff_t(horizon) * o.width, env.image.rgb.end(), ground);
  return env;
}

}  // namespace lambent
