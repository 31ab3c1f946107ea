#include <lambent/basis/svd.h>
#include <lambent/core/check.h>

#include <Eigen/Dense>

namespace lambent {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Svd thin_svd(std::span<const double> A, int m, int n) {
  LAMBENT_CHECK(m >= 1 && n >= 1 && A.size() == size_t(m) * size_t(n));
  const Eigen::Map<const RowMajor> a(A.data(), m, n);
  const Eigen::BDCSVD<Eigen::MatrixXd> d(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Svd out;
  out.m = m, out.n = n, out.k = std::min(m, n);
  out.U.resize(size_t(m) * size_t(out.k)), out.V.resize(size_t(n) * size_t(out.k)), out.s.resize(size_t(out.k));
  Eigen::Map<RowMajor>(out.U.data(), m, out.k) = d.matrixU();
  Eigen::Map<RowMajor>(out.V.data(), n, out.k) = d.matrixV();
  Eigen::Map<Eigen::VectorXd>(out.s.data(), out.k) = d.singularValues();
  return out;
}

}  // namespace lambent
