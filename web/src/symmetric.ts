// Symmetric matrices by their eigenvectors, as basis/symmetric.h.

/** Eigenvalues and unit eigenvectors, [row][vector], of an n x n matrix, row-major: cyclic Jacobi rotations. */
export function symmetricEigen(matrix: ArrayLike<number>, n: number): { values: Float64Array; vectors: Float64Array } {
  const A = Float64Array.from(matrix),
    V = new Float64Array(n * n);
  for (let i = 0; i < n; ++i) V[i * n + i] = 1;
  for (let sweep = 0; sweep < 60; ++sweep) {
    let off = 0,
      all = 0;
    for (let i = 0; i < n; ++i)
      for (let j = 0; j < n; ++j) {
        const square = A[i * n + j]! ** 2;
        all += square;
        if (i !== j) off += square;
      }
    if (off <= 1e-30 * all) break;
    for (let p = 0; p < n; ++p)
      for (let q = p + 1; q < n; ++q) {
        const apq = A[p * n + q]!;
        if (apq === 0) continue;
        const theta = (A[q * n + q]! - A[p * n + p]!) / (2 * apq),
          t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1)),
          c = 1 / Math.sqrt(t * t + 1),
          s = t * c;
        for (let k = 0; k < n; ++k) {
          const x = A[k * n + p]!,
            y = A[k * n + q]!;
          A[k * n + p] = c * x - s * y;
          A[k * n + q] = s * x + c * y;
        }
        for (let k = 0; k < n; ++k) {
          const x = A[p * n + k]!,
            y = A[q * n + k]!;
          A[p * n + k] = c * x - s * y;
          A[q * n + k] = s * x + c * y;
          const u = V[k * n + p]!,
            v = V[k * n + q]!;
          V[k * n + p] = c * u - s * v;
          V[k * n + q] = s * u + c * v;
        }
      }
  }
  return { values: Float64Array.from({ length: n }, (_, i) => A[i * n + i]!), vectors: V };
}

/** Without the eigenvalues at or below `cutoff` times the greatest. */
export function pseudoInverse(matrix: ArrayLike<number>, n: number, cutoff: number): Float64Array {
  const { values, vectors } = symmetricEigen(matrix, n),
    least = cutoff * Math.max(...values),
    out = new Float64Array(n * n);
  values.forEach((value, k) => {
    if (!(value > least)) return;
    for (let i = 0; i < n; ++i) {
      const f = vectors[i * n + k]! / value;
      for (let j = 0; j < n; ++j) out[i * n + j]! += f * vectors[j * n + k]!;
    }
  });
  return out;
}
