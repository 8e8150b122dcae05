// Exact signed distances against Open3D's RaycastingScene::ComputeSignedDistance on the same points: how fast
// (benchmarks), and how often the sign is wrong beside edges and corners (--check).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <open3d/core/Tensor.h>
#include <open3d/t/geometry/RaycastingScene.h>

#include "perception/mesh_sdf.h"
#include "stability/even_samples.h"
#include "stability/shape_families.h"
#include "stability/shapes.h"
#include "tests/sdf_points.h"

namespace dofusion {
namespace {

using open3d::core::Tensor;
using Points = std::vector<Eigen::Vector3d>;

Tensor to_tensor(const Points& points) {
  std::vector<float> floats;
  for (const Eigen::Vector3d& p : points)
    for (int k = 0; k < 3; ++k) floats.push_back(static_cast<float>(p[k]));
  return Tensor(floats, {static_cast<std::int64_t>(points.size()), 3}, open3d::core::Float32);
}

void add_mesh(open3d::t::geometry::RaycastingScene& scene, const TriangleMesh& mesh) {
  std::vector<std::uint32_t> corners;
  for (const Eigen::Vector3i& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) corners.push_back(static_cast<std::uint32_t>(t[k]));
  scene.AddTriangles(to_tensor(mesh.vertices),
                     Tensor(corners, {static_cast<std::int64_t>(mesh.triangles.size()), 3}, open3d::core::UInt32));
}

constexpr double kPi = 3.14159265358979323846;

// A closed surface over a grid of two angles, 2 * rings * sectors triangles.
template <typename Surface>
TriangleMesh wrapped(int rings, int sectors, const Surface& surface) {
  TriangleMesh mesh;
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) mesh.vertices.push_back(surface(2 * kPi * r / rings, 2 * kPi * s / sectors));
  const auto index = [&](int r, int s) { return r % rings * sectors + s % sectors; };
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      mesh.triangles.emplace_back(index(r, s), index(r + 1, s), index(r + 1, s + 1));
      mesh.triangles.emplace_back(index(r, s), index(r + 1, s + 1), index(r, s + 1));
    }
  }
  return mesh;
}

// A ring of 0.1 m with waves in it, 15,000 triangles.
TriangleMesh wavy_ring() {
  return wrapped(125, 60, [](double along, double around) {
    const double tube = 0.015 * (1.0 + 0.3 * std::sin(7 * along) * std::cos(3 * around));
    const double radius = 0.035 + tube * std::cos(around);
    return Eigen::Vector3d(radius * std::cos(along), radius * std::sin(along), tube * std::sin(around));
  });
}

// A mug of the shape families, its triangles cut up to 15,000 or somewhat more: flat faces, sharp edges, thin walls.
TriangleMesh fine_mug() {
  Rng rng = make_rng(41);
  TriangleMesh mesh = draw_shape(ShapeFamilyKind::kMug, rng)->mesh;
  while (mesh.triangles.size() < 15000) mesh = with_longest_edge_halved(mesh);
  return mesh;
}

Points points_in_box(const TriangleMesh& mesh, int count) {
  Rng rng = make_rng(42);
  const BoundingBox box = bounding_box(mesh);
  const Eigen::Vector3d centre = (box.min + box.max) / 2, half = 1.5 * (box.max - box.min) / 2;
  Points points;
  for (int i = 0; i < count; ++i)
    points.push_back(centre + half.cwiseProduct(Eigen::Vector3d(uniform(rng, -1), uniform(rng, -1), uniform(rng, -1))));
  return points;
}

Points points_near_surface(const TriangleMesh& mesh, int count) {
  Rng rng = make_rng(43);
  const BoundingBox box = bounding_box(mesh);
  const double sigma = 0.01 * (box.max - box.min).norm();
  Points points;
  for (const SurfaceSample& s : sample_surface(mesh, count, rng)) points.push_back(s.point + normal3(rng, sigma));
  return points;
}

constexpr int kPoints = 200000;

void register_case(const std::string& mesh_name, const TriangleMesh& mesh, const std::string& points_name,
                   const Points& points, int threads) {
  const std::string name = mesh_name + "/" + points_name + "/" + std::to_string(threads) + "_threads/";
  const auto configured = [](benchmark::internal::Benchmark* b) {
    b->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);
  };
  configured(benchmark::RegisterBenchmark((name + "dofusion").c_str(), [=](benchmark::State& state) {
    const MeshSdf sdf(mesh);
    for (auto _ : state) benchmark::DoNotOptimize(sdf.distances(points, threads));
    state.SetItemsProcessed(state.iterations() * kPoints);
  }));
  configured(benchmark::RegisterBenchmark((name + "open3d").c_str(), [=](benchmark::State& state) {
    open3d::t::geometry::RaycastingScene scene(threads);
    add_mesh(scene, mesh);
    const Tensor tensor = to_tensor(points);
    for (auto _ : state) benchmark::DoNotOptimize(scene.ComputeSignedDistance(tensor, threads));
    state.SetItemsProcessed(state.iterations() * kPoints);
  }));
  if (threads > 1) return;
  configured(benchmark::RegisterBenchmark((name + "dofusion_one_by_one").c_str(), [=](benchmark::State& state) {
    const MeshSdf sdf(mesh);
    for (auto _ : state)
      for (const Eigen::Vector3d& p : points) benchmark::DoNotOptimize(sdf(p));
    state.SetItemsProcessed(state.iterations() * kPoints);
  }));
}

void register_others(const TriangleMesh& mesh) {
  benchmark::RegisterBenchmark("build/dofusion", [=](benchmark::State& state) {
    for (auto _ : state) benchmark::DoNotOptimize(MeshSdf(mesh));
  })->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("holes/near/1_threads/dofusion", [=](benchmark::State& state) {
    TriangleMesh open = mesh;
    open.triangles.resize(open.triangles.size() - 50);
    const MeshSdf sdf(open);
    const Points points = points_near_surface(mesh, kPoints / 10);
    for (auto _ : state) benchmark::DoNotOptimize(sdf.distances(points, 1));
    state.SetItemsProcessed(state.iterations() * kPoints / 10);
  })->Unit(benchmark::kMillisecond);
  for (const int threads : {1, 2}) {
    benchmark::RegisterBenchmark(("grid_of_48/" + std::to_string(threads) + "_threads").c_str(),
                                 [=](benchmark::State& state) {
                                   for (auto _ : state) benchmark::DoNotOptimize(mesh_to_sdf_grid(mesh, {}, threads));
                                 })
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  for (const auto& [name, solid] : {std::pair<std::string, TriangleMesh>{"ring", mesh}, {"hat", block_mesh("hat")}}) {
    benchmark::RegisterBenchmark(("even_samples_1000/" + name).c_str(), [solid = solid](benchmark::State& state) {
      Rng rng = make_rng(44);
      for (auto _ : state) benchmark::DoNotOptimize(sample_surface_evenly(solid, 1000, rng));
    })->Unit(benchmark::kMillisecond);
  }
}

// What a grid's interpolation errs by about a spacing from the surface, in spacings.
void print_grid_errors(const std::string& name, const TriangleMesh& mesh) {
  const SdfGrid grid = mesh_to_sdf_grid(mesh);
  Rng rng = make_rng(45);
  Points points;
  for (const SurfaceSample& s : sample_surface(mesh, 20000, rng))
    points.push_back(s.point + normal3(rng, grid.spacing));
  const std::vector<double> exact = MeshSdf(mesh).distances(points);
  std::vector<double> errors;
  for (std::size_t i = 0; i < points.size(); ++i) errors.push_back(std::abs(grid(points[i]) - exact[i]) / grid.spacing);
  std::sort(errors.begin(), errors.end());
  std::printf("grid of 48 nodes, %s: spacing %.2f mm; error median %.3f, 95 %% %.3f, largest %.3f spacings\n",
              name.c_str(), 1e3 * grid.spacing, errors[errors.size() / 2], errors[errors.size() * 95 / 100],
              errors.back());
}

void register_all() {
  const TriangleMesh ring = wavy_ring(), mug = fine_mug();
  std::printf("ring: %zu triangles, mug: %zu triangles\n", ring.triangles.size(), mug.triangles.size());
  for (const int threads : {1, 2}) {
    register_case("ring", ring, "box", points_in_box(ring, kPoints), threads);
    register_case("ring", ring, "near", points_near_surface(ring, kPoints), threads);
    register_case("mug", mug, "box", points_in_box(mug, kPoints), threads);
    register_case("mug", mug, "near", points_near_surface(mug, kPoints), threads);
  }
  register_others(ring);
}

// ---------------------------------------------------------------------------------------------------------------

struct WrongSigns {
  int points = 0, ours = 0, open3d = 0, open3d_inside = 0;  // points that Open3D finds inside
};

// Points are rounded to floats, as Open3D's are, so that everybody is asked about the same ones. Those nearer to the
// surface than a float can tell are left out.
template <typename Inside>
WrongSigns count_wrong_signs(const TriangleMesh& mesh, int count, Rng& rng, const Inside& inside) {
  constexpr double kFloatCanTell = 2e-8;  // metres
  const MeshSdf sdf(mesh);
  Points points = points_near_edges(mesh, count, rng);
  for (Eigen::Vector3d& p : points) p = p.cast<float>().cast<double>();
  const std::vector<double> ours = sdf.distances(points);
  open3d::t::geometry::RaycastingScene scene(1);
  add_mesh(scene, mesh);
  const std::vector<float> theirs = scene.ComputeSignedDistance(to_tensor(points), 1).ToFlatVector<float>();
  WrongSigns wrong;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (std::abs(ours[i]) < kFloatCanTell) continue;
    ++wrong.points;
    const bool truth = inside(points[i]);
    wrong.ours += (ours[i] < 0) != truth;
    wrong.open3d += (theirs[i] < 0) != truth;
    wrong.open3d_inside += theirs[i] < 0;
  }
  return wrong;
}

void print(const std::string& name, const WrongSigns& wrong) {
  std::printf("%-16s %9d points  wrong signs: dofusion %d, Open3D %d (it finds %d points inside)\n", name.c_str(),
              wrong.points, wrong.ours, wrong.open3d, wrong.open3d_inside);
}

int check() {
  constexpr int kBlockPoints = 1020000, kFamilyPoints = 103000;  // some are too near to the surface and not counted
  WrongSigns all;
  Rng rng = make_rng(4001);
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const std::vector<HalfSpace> planes = half_spaces(mesh);
    const WrongSigns wrong = count_wrong_signs(mesh, kBlockPoints / 7 + 1, rng,
                                               [&](const Eigen::Vector3d& p) { return inside_half_spaces(planes, p); });
    print(name, wrong);
    all = {all.points + wrong.points, all.ours + wrong.ours, all.open3d + wrong.open3d,
           all.open3d_inside + wrong.open3d_inside};
  }
  print("seven blocks", all);
  int bad = all.ours;
  for (const ShapeFamilyKind kind :
       {ShapeFamilyKind::kEll, ShapeFamilyKind::kArch, ShapeFamilyKind::kMug, ShapeFamilyKind::kBowl}) {
    const TriangleMesh mesh = draw_shape(kind, rng)->mesh;
    const WrongSigns wrong = count_wrong_signs(
        mesh, kFamilyPoints, rng, [&](const Eigen::Vector3d& p) { return plain_winding_number(mesh, p) > 0.5; });
    print(to_string(kind), wrong);
    bad += wrong.ours;
  }
  print_grid_errors("ring", wavy_ring());
  print_grid_errors("mug", fine_mug());
  print_grid_errors("hat", block_mesh("hat"));
  return bad == 0 ? 0 : 1;
}

}  // namespace
}  // namespace dofusion

int main(int argc, char** argv) {
  if (argc == 2 && !std::strcmp(argv[1], "--check")) return dofusion::check();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  dofusion::register_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
