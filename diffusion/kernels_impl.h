// Body of kernels.h, included once by each kernels_<level>.cpp inside its own namespace. No standard library inline
// functions here: they would be compiled with wide-vector flags and could be the copy that the linker keeps.

// L: lanes of the widest vectors that this version may use. Channel counts are multiples of 32, so of L.
#if defined(__AVX512F__)
constexpr int L = 16;
#elif defined(__AVX2__)
constexpr int L = 8;
#else
constexpr int L = 4;
#endif
typedef std::uint32_t Pair __attribute__((may_alias));  // two bf16 that were written one by one
typedef float V __attribute__((vector_size(4 * L), aligned(4)));
typedef std::uint32_t U __attribute__((vector_size(4 * L), aligned(4)));
typedef std::int32_t I __attribute__((vector_size(4 * L), aligned(4)));
typedef std::uint8_t B __attribute__((vector_size(L), aligned(1)));
typedef std::uint16_t H __attribute__((vector_size(2 * L), aligned(2)));
constexpr int kPanel = 32 / L;  // vectors in a panel of 32 columns

static inline V load(const float* p) { return *reinterpret_cast<const V*>(p); }
static inline void store(float* p, V v) { *reinterpret_cast<V*>(p) = v; }
static inline U load(const std::uint32_t* p) { return *reinterpret_cast<const U*>(p); }
static inline V splat(float x) { return V{} + x; }
static inline V from_bits(U u) { return reinterpret_cast<V>(u); }
static inline float from_bits(std::uint32_t u) {
  float f;
  __builtin_memcpy(&f, &u, 4);
  return f;
}
static inline V widen(const std::uint16_t* p) {  // L bf16 to float
  return from_bits(__builtin_convertvector(*reinterpret_cast<const H*>(p), U) << 16);
}
// Round to nearest even; the upper half of each lane is the bf16. NaN stays NaN or becomes infinite.
static inline U rounded(V v) {
  const U u = reinterpret_cast<U>(v);
  return u + 0x7fffu + ((u >> 16) & 1u);
}
static inline float sum(V v) {
  float s = 0;
  for (int i = 0; i < L / 4; ++i) s += (v[4 * i] + v[4 * i + 2]) + (v[4 * i + 1] + v[4 * i + 3]);
  return s;
}

#if defined(__AVX512F__)
constexpr int kRows = 12;
#else
constexpr int kRows = 2;
#endif

template <int R>
static inline void tile_bf16(int k2, const Pair* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const std::uint32_t* b,
                             float* c, std::ptrdiff_t c_row, bool accumulate) {
  // Unrolled throughout, so that the sums stay in registers.
  V sum[R][kPanel];
#pragma GCC unroll 12
  for (int r = 0; r < R; ++r)
#pragma GCC unroll 8
    for (int j = 0; j < kPanel; ++j) sum[r][j] = accumulate ? load(c + r * c_row + L * j) : V{};
  for (int k = 0; k < k2; ++k, a += a_k, b += 32) {
#if defined(__AVX512BF16__)
    const __m512bh b0 = (__m512bh)_mm512_loadu_si512(b), b1 = (__m512bh)_mm512_loadu_si512(b + 16);
#pragma GCC unroll 12
    for (int r = 0; r < R; ++r) {
      const __m512bh x = (__m512bh)_mm512_set1_epi32(static_cast<int>(a[r * a_row]));
      sum[r][0] = (V)_mm512_dpbf16_ps((__m512)sum[r][0], x, b0);
      sum[r][1] = (V)_mm512_dpbf16_ps((__m512)sum[r][1], x, b1);
    }
#elif defined(__AVX512F__)
    const U b0 = load(b), b1 = load(b + L);
    const V low0 = from_bits(b0 << 16), high0 = from_bits(b0 & 0xffff0000u);
    const V low1 = from_bits(b1 << 16), high1 = from_bits(b1 & 0xffff0000u);
#pragma GCC unroll 12
    for (int r = 0; r < R; ++r) {
      const std::uint32_t x = a[r * a_row];
      const V low = splat(from_bits(x << 16)), high = splat(from_bits(x & 0xffff0000u));
      sum[r][0] += low * low0;
      sum[r][1] += low * low1;
      sum[r][0] += high * high0;
      sum[r][1] += high * high1;
    }
#else
#pragma GCC unroll 8
    for (int j = 0; j < kPanel; ++j) {
      const U pair = load(b + L * j);
      const V low = from_bits(pair << 16), high = from_bits(pair & 0xffff0000u);
#pragma GCC unroll 12
      for (int r = 0; r < R; ++r) {
        const std::uint32_t x = a[r * a_row];
        sum[r][j] += splat(from_bits(x << 16)) * low;
        sum[r][j] += splat(from_bits(x & 0xffff0000u)) * high;
      }
    }
#endif
  }
#pragma GCC unroll 12
  for (int r = 0; r < R; ++r)
#pragma GCC unroll 8
    for (int j = 0; j < kPanel; ++j) store(c + r * c_row + L * j, sum[r][j]);
}

template <int R>
static void rest_bf16(int m, int k2, const Pair* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const std::uint32_t* b,
                      float* c, std::ptrdiff_t c_row, bool accumulate) {
  if constexpr (R > 0) {
    if (m == R)
      tile_bf16<R>(k2, a, a_row, a_k, b, c, c_row, accumulate);
    else
      rest_bf16<R - 1>(m, k2, a, a_row, a_k, b, c, c_row, accumulate);
  }
}

static void matmul_bf16(int m, int n, int k2, const std::uint32_t* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k,
                        const std::uint32_t* b, float* c, std::ptrdiff_t c_row, bool accumulate) {
  const Pair* pairs = a;
  for (int j = 0; j < n; j += 32, b += std::ptrdiff_t{32} * k2) {
    int i = 0;
    for (; i + kRows <= m; i += kRows)
      tile_bf16<kRows>(k2, pairs + i * a_row, a_row, a_k, b, c + i * c_row + j, c_row, accumulate);
    rest_bf16<kRows - 1>(m - i, k2, pairs + i * a_row, a_row, a_k, b, c + i * c_row + j, c_row, accumulate);
  }
}

template <int R, int W>
static inline void tile_f32(int k_count, const float* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const float* b,
                            std::ptrdiff_t b_row, float* c, std::ptrdiff_t c_row, bool accumulate) {
  V acc[R][W];
#pragma GCC unroll 12
  for (int r = 0; r < R; ++r)
#pragma GCC unroll 8
    for (int j = 0; j < W; ++j) acc[r][j] = accumulate ? load(c + r * c_row + L * j) : V{};
  for (int k = 0; k < k_count; ++k, a += a_k, b += b_row) {
    V x[W];
#pragma GCC unroll 8
    for (int j = 0; j < W; ++j) x[j] = load(b + L * j);
#pragma GCC unroll 12
    for (int r = 0; r < R; ++r)
#pragma GCC unroll 8
      for (int j = 0; j < W; ++j) acc[r][j] += splat(a[r * a_row]) * x[j];
  }
#pragma GCC unroll 12
  for (int r = 0; r < R; ++r)
#pragma GCC unroll 8
    for (int j = 0; j < W; ++j) store(c + r * c_row + L * j, acc[r][j]);
}

template <int W>
static void columns_f32(int m, int k, const float* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const float* b,
                        std::ptrdiff_t b_row, float* c, std::ptrdiff_t c_row, bool accumulate) {
  constexpr int kStep = kRows < 8 ? kRows : 8;
  int i = 0;
  for (; i + kStep <= m; i += kStep)
    tile_f32<kStep, W>(k, a + i * a_row, a_row, a_k, b, b_row, c + i * c_row, c_row, accumulate);
  for (; i < m; ++i) tile_f32<1, W>(k, a + i * a_row, a_row, a_k, b, b_row, c + i * c_row, c_row, accumulate);
}

static void matmul_f32(int m, int n, int k, const float* a, std::ptrdiff_t a_row, std::ptrdiff_t a_k, const float* b,
                       std::ptrdiff_t b_row, float* c, std::ptrdiff_t c_row, bool accumulate) {
  int j = 0;
  for (; j + 32 <= n; j += 32) columns_f32<32 / L>(m, k, a, a_row, a_k, b + j, b_row, c + j, c_row, accumulate);
  if (j < n) columns_f32<16 / L>(m, k, a, a_row, a_k, b + j, b_row, c + j, c_row, accumulate);
}

static void pack_bf16(int k, int n, const float* b, std::ptrdiff_t b_row, std::uint32_t* packed) {
  for (int j = 0; j < n; j += 32)
    for (int i = 0; i < k; i += 2, packed += 32)
      for (int h = 0; h < 32; h += L) {
        const U low = rounded(load(b + i * b_row + j + h)), high = rounded(load(b + (i + 1) * b_row + j + h));
        *reinterpret_cast<U*>(packed + h) = (low >> 16) | (high & 0xffff0000u);
      }
}

static void round_bf16(int rows, int n, const float* x, std::ptrdiff_t x_row, std::uint16_t* out,
                       std::ptrdiff_t out_row) {
  for (int i = 0; i < rows; ++i, x += x_row, out += out_row) {
    int j = 0;
    for (; j + L <= n; j += L) *reinterpret_cast<H*>(out + j) = __builtin_convertvector(rounded(load(x + j)) >> 16, H);
    for (; j < n; ++j) out[j] = static_cast<std::uint16_t>(rounded(splat(x[j]))[0] >> 16);
  }
}

static void pair_rows(int rows, int n, const std::uint16_t* x, std::ptrdiff_t x_row, std::uint32_t* out) {
  for (int i = 0; i < rows; i += 2, out += n) {
    const std::uint16_t *p = x + i * x_row, *q = p + x_row;
    for (int j = 0; j < n; ++j) out[j] = p[j] | static_cast<std::uint32_t>(q[j]) << 16;
  }
}

// Squared distances are not negative, so their bits order as integers; the low bits make room for the point's number.
static void nearest(int points, int k, const float* const coordinates[4], std::uint16_t* neighbours,
                    std::int32_t* keys) {
  int bits = 4;
  while ((1 << bits) < points) ++bits;
  const std::int32_t low = (1 << bits) - 1;
  const int padded = (points + 15) / 16 * 16;
  I lane;
  for (int j = 0; j < L; ++j) lane[j] = j;
  for (int i = 0; i < points; ++i, neighbours += k) {
    V centre[4];
    for (int d = 0; d < 4; ++d) centre[d] = splat(coordinates[d][i]);
    for (int j = 0; j < padded; j += L) {
      V square{};
      for (int d = 0; d < 4; ++d) {
        const V e = load(coordinates[d] + j) - centre[d];
        square += e * e;
      }
      *reinterpret_cast<I*>(keys + j) = (reinterpret_cast<I>(square) & ~low) | (lane + j);
    }
    for (int j = points; j < padded; ++j) keys[j] = 0x7fffffff;
#if defined(__AVX512F__)
    if (k == 16 && points >= 16) {
      __m512i nearest16 = _mm512_loadu_si512(keys);
      std::int32_t worst = _mm512_reduce_max_epi32(nearest16);
      for (int j = 16; j < padded; j += 16) {
        const __m512i candidates = _mm512_loadu_si512(keys + j);
        unsigned closer = _mm512_cmplt_epi32_mask(candidates, _mm512_set1_epi32(worst));
        for (; closer; closer &= closer - 1) {
          const std::int32_t key = keys[j + __builtin_ctz(closer)];
          if (key >= worst) continue;
          nearest16 =
              _mm512_mask_set1_epi32(nearest16, _mm512_cmpeq_epi32_mask(nearest16, _mm512_set1_epi32(worst)), key);
          worst = _mm512_reduce_max_epi32(nearest16);
        }
      }
      const __m512i number = _mm512_and_si512(nearest16, _mm512_set1_epi32(low));
      *reinterpret_cast<H*>(neighbours) = __builtin_convertvector((U)number, H);
      continue;
    }
#endif
    std::int32_t kept[32] = {};
    int worst = 0;
    for (int j = 0; j < k; ++j) {
      kept[j] = keys[j];
      if (kept[j] > kept[worst]) worst = j;
    }
    for (int j = k; j < points; ++j) {
      if (keys[j] >= kept[worst]) continue;
      kept[worst] = keys[j];
      for (int s = 0; s < k; ++s)
        if (kept[s] > kept[worst]) worst = s;
    }
    for (int j = 0; j < k; ++j) neighbours[j] = static_cast<std::uint16_t>(kept[j] & low);
  }
}

static inline float inverse_root(float x) { return 1.0f / __builtin_sqrtf(x); }

static void edge_forward(int points, int c, int k, const float* ab, const std::uint16_t* neighbours, const float* gamma,
                         const float* beta, std::uint16_t* out, std::ptrdiff_t out_row, float* normalised,
                         float* inverse_deviation, std::uint8_t* slot) {
  for (int i = 0; i < points; ++i, neighbours += k, out += out_row, normalised += c, slot += c) {
    const float* a = ab + std::ptrdiff_t{2} * c * i;
    V total{}, squares{};
    for (int j = 0; j < c; j += 2 * L) {
      V best[2];
      I which[2] = {I{}, I{}};
      for (int h = 0; h < 2; ++h) best[h] = load(ab + std::ptrdiff_t{2} * c * neighbours[0] + c + j + L * h);
      for (int s = 1; s < k; ++s) {
        const float* b = ab + std::ptrdiff_t{2} * c * neighbours[s] + c + j;
        for (int h = 0; h < 2; ++h) {
          const V v = load(b + L * h);
          const I larger = v > best[h];
          which[h] = larger ? I{} + s : which[h];
          best[h] = larger ? v : best[h];
        }
      }
      for (int h = 0; h < 2; ++h) {
        const V y = load(a + j + L * h) + best[h];
        store(normalised + j + L * h, y);
        *reinterpret_cast<B*>(slot + j + L * h) = __builtin_convertvector(which[h], B);
        total += y;
        squares += y * y;
      }
    }
    const float mean = sum(total) / c;
    const float variance = sum(squares) / c - mean * mean;
    const float r = inverse_root((variance > 0 ? variance : 0) + 1e-5f);
    inverse_deviation[i] = r;
    for (int j = 0; j < c; j += L) {
      const V x = (load(normalised + j) - mean) * r;
      store(normalised + j, x);
      const V z = load(gamma + j) * x + load(beta + j);
      const V activated = z > 0 ? z : kLeakySlope * z;
      *reinterpret_cast<H*>(out + j) = __builtin_convertvector(rounded(activated) >> 16, H);
    }
  }
}

static void edge_backward(int points, int c, int k, const float* d_out, std::ptrdiff_t d_row,
                          const std::uint16_t* neighbours, const float* gamma, const float* beta,
                          const float* normalised, const float* inverse_deviation, const std::uint8_t* slot,
                          float* d_ab, float* d_gamma, float* d_beta) {
  for (int i = 0; i < points; ++i)
    for (int j = 0; j < c; j += L) store(d_ab + std::ptrdiff_t{2} * c * i + c + j, V{});
  for (int i = 0; i < points; ++i, neighbours += k, d_out += d_row, normalised += c, slot += c) {
    float* d_a = d_ab + std::ptrdiff_t{2} * c * i;
    V total{}, along{};
    for (int j = 0; j < c; j += L) {
      const V x = load(normalised + j), g = load(gamma + j);
      const V z = g * x + load(beta + j);
      const V d = load(d_out + j);
      const V d_z = z > 0 ? d : kLeakySlope * d;
      store(d_gamma + j, load(d_gamma + j) + d_z * x);
      store(d_beta + j, load(d_beta + j) + d_z);
      const V d_x = d_z * g;
      store(d_a + j, d_x);
      total += d_x;
      along += d_x * x;
    }
    const float mean = sum(total) / c, mean_along = sum(along) / c, r = inverse_deviation[i];
    float* d_b[32];
    for (int s = 0; s < k; ++s) d_b[s] = d_ab + std::ptrdiff_t{2} * c * neighbours[s] + c;
    for (int j = 0; j < c; j += L) {
      const V d_y = r * (load(d_a + j) - mean - load(normalised + j) * mean_along);
      store(d_a + j, d_y);
      std::uint8_t s[L];
      float d[L];
      __builtin_memcpy(s, slot + j, sizeof(s));
      __builtin_memcpy(d, &d_y, sizeof(d));
      for (int h = 0; h < L; ++h) d_b[s[h]][j + h] += d[h];
    }
  }
}

static void column_max(int rows, int n, const float* x, float* maximum, std::int32_t* row) {
  for (int j = 0; j < n; j += L) {
    V best = load(x + j);
    I which{};
    for (int i = 1; i < rows; ++i) {
      const V v = load(x + std::ptrdiff_t{1} * i * n + j);
      const I larger = v > best;
      which = larger ? I{} + i : which;
      best = larger ? v : best;
    }
    store(maximum + j, best);
    *reinterpret_cast<I*>(row + j) = which;
  }
}

static void column_sum_bf16(int rows, int n, const std::uint16_t* x, std::ptrdiff_t x_row, float factor, float* out) {
  for (int j = 0; j < n; j += L) {
    V total{};
    for (int i = 0; i < rows; ++i) total += widen(x + i * x_row + j);
    store(out + j, total * factor);
  }
}

static void axpy(int n, float a, const float* x, float* y) {
  for (int j = 0; j < n; j += L) store(y + j, load(y + j) + a * load(x + j));
}

static void axpy_bf16(int n, float a, const std::uint16_t* x, float* y) {
  for (int j = 0; j < n; j += L) store(y + j, load(y + j) + a * widen(x + j));
}
