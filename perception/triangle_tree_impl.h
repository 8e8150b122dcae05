// Body of triangle_tree.h's search, included once by each triangle_tree_<level>.cpp inside its own namespace. No inline
// functions of the standard library or Eigen here: they would be compiled with wide-vector flags and could be the copy
// that the linker keeps.

typedef float V __attribute__((vector_size(32)));
typedef std::int32_t I __attribute__((vector_size(32)));

static inline V load(const float* p) { return *reinterpret_cast<const V*>(p); }
static inline V splat(float x) { return V{} + x; }
static inline V select(I mask, V yes, V no) {
  return reinterpret_cast<V>((mask & reinterpret_cast<I>(yes)) | (~mask & reinterpret_cast<I>(no)));
}
static inline V smaller(V x, V y) { return x < y ? x : y; }
static inline V larger(V x, V y) { return x > y ? x : y; }
static inline V clamped(V x, V high) { return smaller(larger(x, V{}), high); }

// Bit i: lane i of the mask is set.
static inline unsigned bits_of(I mask) {
#if defined(__AVX__)
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  unsigned bits = 0;
  for (int i = 0; i < kTreeLanes; ++i) bits |= mask[i] ? 1U << i : 0U;
  return bits;
#endif
}

static inline V squared_box_distances(const TreeNode& node, const V p[3]) {
  V square{};
  for (int k = 0; k < 3; ++k) {
    const V beyond = larger(larger(load(node.low[k]) - p[k], p[k] - load(node.high[k])), V{});
    square += beyond * beyond;
  }
  return square;
}

// In each triangle's plane: the height over it and the distance to the nearest of the sides, or none if over the face.
static inline V squared_triangle_distances(const TrianglePacket& t, const V p[3]) {
  const V q[3] = {p[0] - load(t.a[0]), p[1] - load(t.a[1]), p[2] - load(t.a[2])};
  const V u = q[0] * load(t.x[0]) + q[1] * load(t.x[1]) + q[2] * load(t.x[2]);
  const V v = q[0] * load(t.y[0]) + q[1] * load(t.y[1]) + q[2] * load(t.y[2]);
  const V height = q[0] * load(t.z[0]) + q[1] * load(t.z[1]) + q[2] * load(t.z[2]);
  const V b = load(t.b), cx = load(t.cx), cy = load(t.cy);

  const V du = u - clamped(u, b);
  const V to_ab = du * du + v * v;

  const V ex = cx - b, wx = u - b;
  const V along_bc = clamped((wx * ex + v * cy) * load(t.bc_inverse_square), splat(1.0F));
  const V bx = wx - along_bc * ex, by = v - along_bc * cy;
  const V to_bc = bx * bx + by * by;

  const V along_ac = clamped((u * cx + v * cy) * load(t.ca_inverse_square), splat(1.0F));
  const V ax = u - along_ac * cx, ay = v - along_ac * cy;
  const V to_ca = ax * ax + ay * ay;

  const I over = (v >= V{}) & (ex * v - cy * wx >= V{}) & (cy * u - cx * v >= V{});
  return height * height + select(over, V{}, smaller(smaller(to_ab, to_bc), to_ca));
}

static inline double dot(const double x[3], const double y[3]) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; }

static inline double squared_remainder(const double q[3], const double ab[3], double s, const double ac[3], double t) {
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double r = q[k] - s * ab[k] - t * ac[k];
    square += r * r;
  }
  return square;
}

// After Ericson, Real-Time Collision Detection, 5.1.5, as in stability/signed_triangles.cpp.
static double exact_squared_distance(const ExactTriangle& triangle, const double p[3]) {
  const double* ab = triangle.ab;
  const double* ac = triangle.ac;
  const double q[3] = {p[0] - triangle.a[0], p[1] - triangle.a[1], p[2] - triangle.a[2]};
  const double bq[3] = {q[0] - ab[0], q[1] - ab[1], q[2] - ab[2]};
  const double cq[3] = {q[0] - ac[0], q[1] - ac[1], q[2] - ac[2]};
  const double d1 = dot(ab, q), d2 = dot(ac, q), d3 = dot(ab, bq), d4 = dot(ac, bq), d5 = dot(ab, cq), d6 = dot(ac, cq);
  if (d1 <= 0 && d2 <= 0) return dot(q, q);
  if (d3 >= 0 && d4 <= d3) return dot(bq, bq);
  if (d6 >= 0 && d5 <= d6) return dot(cq, cq);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return squared_remainder(q, ab, d1 / (d1 - d3), ac, 0.0);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return squared_remainder(q, ab, 0.0, ac, d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return squared_remainder(q, ab, 1.0 - t, ac, t);
  }
  const double scale = 1.0 / (va + vb + vc);
  return squared_remainder(q, ab, vb * scale, ac, vc * scale);
}

// A box or triangle whose float distance is beyond this is certainly farther than `squared`. Floats err by some units
// of 2^-24 times the coordinates; FLT_MAX while nothing was found, so that empty lanes, at infinity, are left out.
static inline float reach_of(double squared, double slack) {
  const double reach = __builtin_sqrt(squared) + slack;
  const double square = reach * reach * (1.0 + 1e-6);
  return square < FLT_MAX ? static_cast<float>(square) : FLT_MAX;
}

constexpr int kMostPending = 7 * 64 + 8;  // a tree is at most 64 deep

struct Pending {
  std::int32_t child;
  float squared;
};

static NearestTriangle search(const TreeArrays& tree, const double point[3], int start) {
  NearestTriangle nearest;
  double size = tree.half_size;
  for (int k = 0; k < 3; ++k) size = __builtin_fabs(point[k]) > size ? __builtin_fabs(point[k]) : size;
  constexpr double kFloatErrors = 24.0 * 5.960464477539063e-08;
  const double slack = kFloatErrors * size;
  if (start >= 0) nearest = {start, exact_squared_distance(tree.exact[start], point)};
  float reach = reach_of(nearest.squared, slack);
  V p[3];
  for (int k = 0; k < 3; ++k) p[k] = splat(static_cast<float>(point[k]));

  Pending stack[kMostPending];
  int pending = 0;
  std::int32_t child = 0;
  for (;;) {
    if (child >= 0) {
      const TreeNode& node = tree.nodes[child];
      const V square = squared_box_distances(node, p);
      unsigned near = bits_of(square <= splat(reach));
      const int first = pending;
      while (near) {  // the nearest on top
        const int lane = __builtin_ctz(near);
        near &= near - 1;
        const Pending next{node.child[lane], square[lane]};
        int at = pending++;
        for (; at > first && stack[at - 1].squared < next.squared; --at) stack[at] = stack[at - 1];
        stack[at] = next;
      }
    } else {
      const int packet = ~child;
      V square = squared_triangle_distances(tree.packets[packet], p);
      unsigned near = bits_of(square <= splat(reach));
      while (near) {  // the most promising first: the others may be out of reach then
        int lane = __builtin_ctz(near);
        for (unsigned rest = near & (near - 1); rest; rest &= rest - 1) {
          const int other = __builtin_ctz(rest);
          if (square[other] < square[lane]) lane = other;
        }
        near &= ~(1U << lane);
        const int slot = kTreeLanes * packet + lane;
        if (slot == start) continue;
        const double squared = exact_squared_distance(tree.exact[slot], point);
        if (!(squared < nearest.squared)) continue;
        nearest = {slot, squared};
        reach = reach_of(squared, slack);
        near &= bits_of(square <= splat(reach));
      }
    }
    do {
      if (pending == 0) return nearest;
      --pending;
    } while (!(stack[pending].squared <= reach));
    child = stack[pending].child;
  }
}
