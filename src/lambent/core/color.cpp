// C. Wyman, P.-P. Sloan and P. Shirley 2013; ITU-R BT.709; ISO/CIE 11664-2 (D65).
#include <lambent/core/color.h>

#include <iterator>

namespace lambent {

Vec3d cie_matching_functions(double nm) {
  auto lobe = [nm](double height, double centre, double below, double above) {
    double t = (nm - centre) / (nm < centre ? below : above);
    return height * std::exp(-0.5 * t * t);
  };
  return {lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
          lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
          lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)};
}

Vec3d rec709_from_xyz(Vec3d c) {
  return {3.2409699 * c.x - 1.5373832 * c.y - 0.4986108 * c.z, -0.9692436 * c.x + 1.8759675 * c.y + 0.0415551 * c.z,
          0.0556301 * c.x - 0.2039770 * c.y + 1.0569715 * c.z};
}

double illuminant_d65(double nm) {
  static constexpr double first = 380, step = 10;
  static constexpr double power[] = {49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812,
                                     114.861, 115.923, 108.811, 109.354, 107.802, 104.790, 107.689, 104.405, 104.046,
                                     100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992,
                                     80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.3490, 61.6040, 69.8856,
                                     75.0870, 63.5927, 46.4182, 66.8054, 63.3828};
  constexpr int last = int(std::size(power)) - 1;
  const double x = (nm - first) / step;
  if (!(x >= 0 && x <= last)) return 0;
  const int i = std::min(int(x), last - 1);
  return power[i] + (x - i) * (power[i + 1] - power[i]);
}

}  // namespace lambent
