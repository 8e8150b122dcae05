// Every version of the kernels that this processor runs against plain formulas.
#include "diffusion/kernels.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "stability/random.h"

namespace dofusion::kernels {
namespace {

std::vector<float> random_floats(std::size_t count, std::uint64_t seed) {
  Rng rng = make_rng(seed);
  std::vector<float> x(count);
  for (float& v : x) v = static_cast<float>(normal(rng));
  return x;
}

float widen(std::uint16_t bits) {
  const std::uint32_t u = static_cast<std::uint32_t>(bits) << 16;
  float x;
  std::memcpy(&x, &u, 4);
  return x;
}

class KernelsTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    kernels_ = by_name(GetParam());
    if (!kernels_) GTEST_SKIP() << "this processor has no " << GetParam();
  }
  std::vector<std::uint16_t> rounded(const std::vector<float>& x) const {
    std::vector<std::uint16_t> out(x.size());
    kernels_->round_bf16(1, static_cast<int>(x.size()), x.data(), 0, out.data(), 0);
    return out;
  }
  const Kernels* kernels_ = nullptr;
};

TEST_P(KernelsTest, RoundsToTheNearestBf16) {
  const std::vector<float> x = random_floats(1000, 1);
  const std::vector<std::uint16_t> y = rounded(x);
  // bf16 has 8 significant bits: half a unit is 2^-9 of the value at most.
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_LE(std::abs(widen(y[i]) - x[i]), std::abs(x[i]) / 256.0f);
  EXPECT_EQ(widen(rounded({1.0f, 1.00390625f})[1]), 1.0f);       // half way: to even
  EXPECT_EQ(widen(rounded({1.0f, 1.01171875f})[1]), 1.015625f);  // half way: to even
}

TEST_P(KernelsTest, Bf16Product) {
  for (const int m : {1, 7, 12, 37}) {
    const int n = 64, k = 10, lda = 14;
    const std::vector<std::uint16_t> a = rounded(random_floats(static_cast<std::size_t>(m) * lda, 2));
    const std::vector<float> b = random_floats(k * n, 3);
    const std::vector<std::uint16_t> b16 = rounded(b);
    std::vector<std::uint32_t> packed(k * n / 2);
    kernels_->pack_bf16(k, n, b.data(), n, packed.data());
    std::vector<float> c(static_cast<std::size_t>(m) * n, 0.5f);
    kernels_->matmul_bf16(m, n, k / 2, reinterpret_cast<const std::uint32_t*>(a.data()), lda / 2, 1, packed.data(),
                          c.data(), n, true);
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) {
        double sum = 0.5;
        for (int s = 0; s < k; ++s) sum += double(widen(a[i * lda + s])) * widen(b16[s * n + j]);
        EXPECT_NEAR(c[i * n + j], sum, 1e-5);  // float32 sums of 10 terms of order 1
      }
  }
}

// The product of a transposed matrix, as weight gradients need it.
TEST_P(KernelsTest, Bf16ProductOfPairedRows) {
  const int rows = 24, m = 17, n = 32;
  const std::vector<std::uint16_t> x = rounded(random_floats(rows * m, 4));
  const std::vector<float> d = random_floats(rows * n, 5);
  const std::vector<std::uint16_t> d16 = rounded(d);
  std::vector<std::uint32_t> pairs(rows * m / 2), packed(rows * n / 2);
  kernels_->pair_rows(rows, m, x.data(), m, pairs.data());
  kernels_->pack_bf16(rows, n, d.data(), n, packed.data());
  std::vector<float> c(m * n);
  kernels_->matmul_bf16(m, n, rows / 2, pairs.data(), 1, m, packed.data(), c.data(), n, false);
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) {
      double sum = 0;
      for (int r = 0; r < rows; ++r) sum += double(widen(x[r * m + i])) * widen(d16[r * n + j]);
      EXPECT_NEAR(c[i * n + j], sum, 2e-5);
    }
}

TEST_P(KernelsTest, FloatProduct) {
  for (const int n : {16, 32, 80})
    for (const int m : {1, 8, 13}) {
      const int k = 9;
      const std::vector<float> a = random_floats(m * k, 6), b = random_floats(k * n, 7);
      std::vector<float> c(m * n), transposed(m * k), c2(m * n, 1.0f);
      for (int i = 0; i < m; ++i)
        for (int s = 0; s < k; ++s) transposed[s * m + i] = a[i * k + s];
      kernels_->matmul_f32(m, n, k, a.data(), k, 1, b.data(), n, c.data(), n, false);
      kernels_->matmul_f32(m, n, k, transposed.data(), 1, m, b.data(), n, c2.data(), n, true);
      for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
          double sum = 0;
          for (int s = 0; s < k; ++s) sum += double(a[i * k + s]) * b[s * n + j];
          EXPECT_NEAR(c[i * n + j], sum, 1e-5);
          EXPECT_NEAR(c2[i * n + j], sum + 1, 1e-5);
        }
    }
}

TEST_P(KernelsTest, NearestNeighbours) {
  for (const int points : {32, 50, 192}) {
    for (const int k : {16, 20}) {
      const int padded = (points + 15) / 16 * 16;
      const std::vector<float> x = random_floats(4 * static_cast<std::size_t>(padded), 8);
      const float* columns[4] = {&x[0], &x[padded], &x[2 * padded], &x[3 * padded]};
      std::vector<std::uint16_t> neighbours(points * k);
      std::vector<std::int32_t> keys(padded);
      kernels_->nearest(points, k, columns, neighbours.data(), keys.data());
      for (int i = 0; i < points; ++i) {
        std::vector<double> all;
        const auto square = [&](int j) {
          double s = 0;
          for (const float* column : columns) s += (double(column[j]) - column[i]) * (double(column[j]) - column[i]);
          return s;
        };
        for (int j = 0; j < points; ++j) all.push_back(square(j));
        std::sort(all.begin(), all.end());
        const std::set<int> found(&neighbours[i * k], &neighbours[i * k] + k);
        EXPECT_EQ(found.size(), static_cast<std::size_t>(k));
        EXPECT_EQ(found.count(i), 1u);
        for (const int j : found) EXPECT_LE(square(j), all[k - 1] * (1 + 1.0 / 1024) + 1e-30);
      }
    }
  }
}

struct EdgeCase {
  int points = 20, c = 64, k = 6;
  std::vector<float> ab, gamma, beta, d_out;
  std::vector<std::uint16_t> neighbours;
  EdgeCase() {
    ab = random_floats(points * 2 * c, 9);
    gamma = random_floats(c, 10);
    beta = random_floats(c, 11);
    d_out = random_floats(points * c, 12);
    Rng rng = make_rng(13);
    for (int i = 0; i < points * k; ++i)
      neighbours.push_back(static_cast<std::uint16_t>(uniform_int(rng, 0, points - 1)));
  }
  // The formula in double precision; the sum over the outputs times d_out is a scalar whose gradient is known.
  std::vector<double> output(const std::vector<double>& products, const std::vector<double>& g,
                             const std::vector<double>& b) const {
    std::vector<double> out(points * c);
    for (int i = 0; i < points; ++i) {
      std::vector<double> y(c);
      double mean = 0, variance = 0;
      for (int j = 0; j < c; ++j) {
        double best = -1e300;
        for (int s = 0; s < k; ++s) best = std::max(best, products[neighbours[i * k + s] * 2 * c + c + j]);
        y[j] = products[i * 2 * c + j] + best;
        mean += y[j] / c;
      }
      for (int j = 0; j < c; ++j) variance += (y[j] - mean) * (y[j] - mean) / c;
      for (int j = 0; j < c; ++j) {
        const double z = g[j] * (y[j] - mean) / std::sqrt(variance + 1e-5) + b[j];
        out[i * c + j] = z > 0 ? z : kLeakySlope * z;
      }
    }
    return out;
  }
};

TEST_P(KernelsTest, EdgeConvolutionAndItsGradient) {
  const EdgeCase e;
  const int n = e.points * e.c;
  std::vector<std::uint16_t> out(n);
  std::vector<float> normalised(n), deviation(e.points), d_ab(2 * n), d_gamma(e.c), d_beta(e.c);
  std::vector<std::uint8_t> slot(n);
  kernels_->edge_forward(e.points, e.c, e.k, e.ab.data(), e.neighbours.data(), e.gamma.data(), e.beta.data(),
                         out.data(), e.c, normalised.data(), deviation.data(), slot.data());
  const std::vector<double> ab(e.ab.begin(), e.ab.end()), gamma(e.gamma.begin(), e.gamma.end()),
      beta(e.beta.begin(), e.beta.end());
  const std::vector<double> wanted = e.output(ab, gamma, beta);
  for (int i = 0; i < n; ++i) EXPECT_NEAR(widen(out[i]), wanted[i], std::abs(wanted[i]) / 200 + 1e-4);  // bf16

  kernels_->edge_backward(e.points, e.c, e.k, e.d_out.data(), e.c, e.neighbours.data(), e.gamma.data(), e.beta.data(),
                          normalised.data(), deviation.data(), slot.data(), d_ab.data(), d_gamma.data(), d_beta.data());
  const auto scalar = [&](const std::vector<double>& p, const std::vector<double>& g, const std::vector<double>& b) {
    const std::vector<double> y = e.output(p, g, b);
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += y[i] * e.d_out[i];
    return sum;
  };
  // Central differences in double precision: with steps of 1e-6 good to about 1e-8, unless a step crosses a kink.
  const auto difference = [&](const std::vector<double>& x, int i, auto f) {
    std::vector<double> up = x, down = x;
    up[i] += 1e-6;
    down[i] -= 1e-6;
    return (f(up) - f(down)) / 2e-6;
  };
  for (int i = 0; i < 2 * n; i += 7)
    EXPECT_NEAR(d_ab[i], difference(ab, i, [&](const auto& x) { return scalar(x, gamma, beta); }), 1e-3) << i;
  for (int j = 0; j < e.c; ++j) {
    EXPECT_NEAR(d_gamma[j], difference(gamma, j, [&](const auto& x) { return scalar(ab, x, beta); }), 1e-3);
    EXPECT_NEAR(d_beta[j], difference(beta, j, [&](const auto& x) { return scalar(ab, gamma, x); }), 1e-3);
  }
}

TEST_P(KernelsTest, ColumnMaximumAndSum) {
  const int rows = 33, n = 64;
  const std::vector<float> x = random_floats(rows * n, 14);
  const std::vector<std::uint16_t> x16 = rounded(x);
  std::vector<float> maximum(n), mean(n);
  std::vector<std::int32_t> row(n);
  kernels_->column_max(rows, n, x.data(), maximum.data(), row.data());
  kernels_->column_sum_bf16(rows, n, x16.data(), n, 0.5f, mean.data());
  for (int j = 0; j < n; ++j) {
    double sum = 0;
    for (int i = 0; i < rows; ++i) {
      EXPECT_LE(x[i * n + j], maximum[j]);
      sum += 0.5 * widen(x16[i * n + j]);
    }
    EXPECT_EQ(x[row[j] * n + j], maximum[j]);
    EXPECT_NEAR(mean[j], sum, 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Versions, KernelsTest, testing::Values("avx512_bf16", "avx512", "avx2", "generic"),
                         [](const auto& version) { return std::string(version.param); });

TEST(Kernels, GenericRunsEverywhereAndUnknownNamesAreNothing) {
  EXPECT_NE(by_name("generic"), nullptr);
  EXPECT_EQ(by_name("sse9"), nullptr);
}

}  // namespace
}  // namespace dofusion::kernels
