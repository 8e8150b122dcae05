// The inner loops of the network, in versions for AVX-512 with bf16, AVX-512, AVX2 and any processor, chosen at run
// time. All versions come from kernels_impl.h, compiled with different flags.
//
// Products take bf16 operands in pairs along the summed dimension: one uint32 holds elements k (low half) and k+1
// (high half). Sums are float32 throughout.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dofusion::kernels {

struct Kernels {
  const char* name;

  // C (+)= A B. A: element pair (i, k2) at a[i * a_row + k2 * a_k]. B: packed in panels of 32 columns,
  // (n / 32, k2, 32) pairs. C: (m, n), rows c_row apart. n must be a multiple of 32.
  void (*matmul_bf16)(int m, int n, int k2, const std::uint32_t* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k,
                      const std::uint32_t* b, float* c, std::ptrdiff_t c_row, bool accumulate);

  // C (+)= A B in float32. A: element (i, k) at a[i * a_row + k * a_k]. B: (k, n), rows b_row apart; n must be a
  // multiple of 16.
  void (*matmul_f32)(int m, int n, int k, const float* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const float* b,
                     std::ptrdiff_t b_row, float* c, std::ptrdiff_t c_row, bool accumulate);

  // Packs B (k, n), rows b_row apart, for matmul_bf16. k must be even, n a multiple of 32.
  void (*pack_bf16)(int k, int n, const float* b, std::ptrdiff_t b_row, std::uint32_t* packed);

  // Rounds rows of n (even) floats to bf16: (rows, n), destination rows out_row uint16 apart.
  void (*round_bf16)(int rows, int n, const float* x, std::ptrdiff_t x_row, std::uint16_t* out, std::ptrdiff_t out_row);

  // Pairs rows 2i and 2i+1 of X (rows, n) bf16, rows x_row apart, into (rows / 2, n) uint32.
  void (*pair_rows)(int rows, int n, const std::uint16_t* x, std::ptrdiff_t x_row, std::uint32_t* out);

  // The k nearest points (the point itself included) of every point by |p - q|^2 + (flag_p - flag_q)^2 of coordinates
  // in separate arrays, each of `points` rounded up to 16 floats (the filling is ignored). neighbours: (points, k), in
  // no particular order. k <= 32, points <= 4096; ties and near ties (relative 2^-11) go to any of the points.
  void (*nearest)(int points, int k, const float* const coordinates[4], std::uint16_t* neighbours, std::int32_t* keys);

  // Edge convolution after its products: y_i = a_i + max_j b_j over the neighbours j of i; x^ = layer norm of y_i over
  // the channels; out = leaky(gamma x^ + beta). ab: (points, 2 c) with a first; out: bf16, rows out_row apart;
  // normalised x^: (points, c); inverse deviation: (points); slot of the maximum: (points, c). c multiple of 32.
  void (*edge_forward)(int points, int c, int k, const float* ab, const std::uint16_t* neighbours, const float* gamma,
                       const float* beta, std::uint16_t* out, std::ptrdiff_t out_row, float* normalised,
                       float* inverse_deviation, std::uint8_t* slot);

  // Its gradient: d_out (points, c), rows d_row apart -> d_ab (points, 2 c); d_gamma and d_beta are added to.
  void (*edge_backward)(int points, int c, int k, const float* d_out, std::ptrdiff_t d_row,
                        const std::uint16_t* neighbours, const float* gamma, const float* beta, const float* normalised,
                        const float* inverse_deviation, const std::uint8_t* slot, float* d_ab, float* d_gamma,
                        float* d_beta);

  // Column-wise maximum of x (rows, n) and the row it is in.
  void (*column_max)(int rows, int n, const float* x, float* maximum, std::int32_t* row);

  // out[j] = sum over rows of bf16 x (rows, n), rows x_row apart, times `factor`.
  void (*column_sum_bf16)(int rows, int n, const std::uint16_t* x, std::ptrdiff_t x_row, float factor, float* out);

  // y += a x, for float32 and for bf16 x.
  void (*axpy)(int n, float a, const float* x, float* y);
  void (*axpy_bf16)(int n, float a, const std::uint16_t* x, float* y);
};

inline constexpr float kLeakySlope = 0.2f;

// The fastest version this processor runs.
const Kernels& best();

// "avx512_bf16", "avx512", "avx2" or "generic"; nullptr if this processor cannot run it or the name is unknown.
const Kernels* by_name(const char* name);

}  // namespace dofusion::kernels
