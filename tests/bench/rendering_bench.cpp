// Speed of the scanner beside bare Embree loops over the same rays: 640 x 480 pixels of three blocks on a table, on two
// threads. All three take turns in one run, since machines are noisy; compare the ratios.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <limits>
#include <vector>

#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>

#include "perception/scanner.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr int kThreads = 2;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
const Camera kCamera{600.0, 600.0, 319.5, 239.5, 640, 480, 1.0};
constexpr double kMegarays = 640 * 480 * 1e-6;

Pose view() { return look_at({0.45, -0.35, 0.42}, {0, 0, 0.03}); }

Scene three_blocks() {
  return {{make_block("cube"), make_block("hat"), make_block("tall_triangle")},
          {make_pose(so3_exp({0, 0, 0.3}), {0, 0, 0.025}), make_pose(so3_exp({0, 0, 1.1}), {0.08, 0.03, 0.02}),
           make_pose(so3_exp({0, 0, -0.7}), {-0.05, 0.09, 0.04})}};
}

// What a program has that calls Embree itself: the scene's triangles in one tree, with Embree's defaults.
class BareScene {
 public:
  explicit BareScene(const Scene& scene) : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
    for (std::size_t i = 0; i < scene.objects.size(); ++i) attach(scene.objects[i]->mesh, scene.T_world_object[i]);
    const double h = ScannerOptions().table_half_size;
    attach({{{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}}, {{0, 1, 2}, {0, 2, 3}}}, Pose::Identity());
    rtcCommitScene(scene_);
  }
  ~BareScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  BareScene(const BareScene&) = delete;
  BareScene& operator=(const BareScene&) = delete;
  RTCScene get() const { return scene_; }

 private:
  void attach(const TriangleMesh& mesh, const Pose& T_world_mesh) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), mesh.vertices.size()));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), mesh.triangles.size()));
    for (const Eigen::Vector3d& vertex : mesh.vertices) {
      const Eigen::Vector3d p = T_world_mesh * vertex;
      for (int k = 0; k < 3; ++k) *vertices++ = static_cast<float>(p[k]);
    }
    for (const Eigen::Vector3i& triangle : mesh.triangles)
      for (int k = 0; k < 3; ++k) *indices++ = static_cast<unsigned>(triangle[k]);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  RTCDevice device_;
  RTCScene scene_;
};

// Directions of the camera's rays in the world, of length 1 along the optical axis.
struct Rays {
  explicit Rays(const Pose& T_world_camera)
      : origin(T_world_camera.translation().cast<float>()),
        first((T_world_camera.linear() * unproject(kCamera, 0, 0, 1.0)).cast<float>()),
        right((T_world_camera.linear().col(0) / kCamera.fx).cast<float>()),
        down((T_world_camera.linear().col(1) / kCamera.fy).cast<float>()) {}
  Eigen::Vector3f origin, first, right, down;
};

// (a) Packets of 16 through 4 x 4 pixels; the rays are made and cast, nothing is written but a count of the hits.
std::int64_t cast_packets(RTCScene scene, const Rays& rays) {
  std::array<std::int64_t, kThreads> hits{};
  parallel_for(kCamera.height / 16, kThreads, [&](std::int64_t band, int thread) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    RTCRayHit16 packet;
    alignas(64) int valid[16];
    alignas(64) float offset[3][16];
    for (int k = 0; k < 16; ++k) {
      valid[k] = -1;
      const Eigen::Vector3f d = static_cast<float>(k % 4) * rays.right + static_cast<float>(k / 4) * rays.down;
      for (int axis = 0; axis < 3; ++axis) offset[axis][k] = d[axis];
      packet.ray.org_x[k] = rays.origin.x();
      packet.ray.org_y[k] = rays.origin.y();
      packet.ray.org_z[k] = rays.origin.z();
      packet.ray.tnear[k] = 0.0f;
      packet.ray.time[k] = 0.0f;
      packet.ray.mask[k] = ~0u;
      packet.ray.flags[k] = 0;
    }
    std::int64_t count = 0;
    for (int row = static_cast<int>(band) * 16; row < static_cast<int>(band + 1) * 16; row += 4)
      for (int column = 0; column < kCamera.width; column += 4) {
        const Eigen::Vector3f d =
            rays.first + static_cast<float>(column) * rays.right + static_cast<float>(row) * rays.down;
        for (int k = 0; k < 16; ++k) {
          packet.ray.dir_x[k] = d.x() + offset[0][k];
          packet.ray.dir_y[k] = d.y() + offset[1][k];
          packet.ray.dir_z[k] = d.z() + offset[2][k];
          packet.ray.tfar[k] = kInfinity;
          packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
          packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect16(valid, scene, &context, &packet);
        for (int k = 0; k < 16; ++k) count += packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
      }
    hits[static_cast<std::size_t>(thread)] += count;
  });
  return hits[0] + hits[1];
}

// (b) One ray at a time, as in Embree's tutorials.
std::int64_t cast_single_rays(RTCScene scene, const Rays& rays) {
  std::array<std::int64_t, kThreads> hits{};
  parallel_for(kCamera.height / 16, kThreads, [&](std::int64_t band, int thread) {
    std::int64_t count = 0;
    for (int row = static_cast<int>(band) * 16; row < static_cast<int>(band + 1) * 16; ++row)
      for (int column = 0; column < kCamera.width; ++column) {
        const Eigen::Vector3f d =
            rays.first + static_cast<float>(column) * rays.right + static_cast<float>(row) * rays.down;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRayHit ray{};
        ray.ray.org_x = rays.origin.x();
        ray.ray.org_y = rays.origin.y();
        ray.ray.org_z = rays.origin.z();
        ray.ray.dir_x = d.x();
        ray.ray.dir_y = d.y();
        ray.ray.dir_z = d.z();
        ray.ray.tfar = kInfinity;
        ray.ray.mask = ~0u;
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &ray);
        count += ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      }
    hits[static_cast<std::size_t>(thread)] += count;
  });
  return hits[0] + hits[1];
}

// Of every image of one kind.
struct Times {
  std::vector<double> wall, processor;  // seconds; the processor's of all threads together

  template <class Work>
  void add(const Work& work) {
    const std::clock_t processor_start = std::clock();
    const auto start = std::chrono::steady_clock::now();
    work();
    wall.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    processor.push_back(static_cast<double>(std::clock() - processor_start) / CLOCKS_PER_SEC);
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How many times as fast as `other`, the median over the rounds.
double speed_ratio(const std::vector<double>& own, const std::vector<double>& other) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < own.size(); ++i) ratios.push_back(other[i] / own[i]);
  return median(ratios);
}

// Each iteration is one image of every kind; the counters are medians over the iterations. Ratios "in_cpu" are of
// processor time: the ones to trust where other programs run.
void BM_Rendering(benchmark::State& state) {
  const Scene scene = three_blocks();
  const BareScene bare(scene);
  ScannerOptions options;
  options.threads = kThreads;
  Scanner scanner(scene.objects, options);
  scanner.set_poses(scene.T_world_object);
  const Rays rays(view());
  Scan scan;
  Times packets, singles, kept, fresh;
  for (auto _ : state) {
    packets.add([&] { benchmark::DoNotOptimize(cast_packets(bare.get(), rays)); });
    singles.add([&] { benchmark::DoNotOptimize(cast_single_rays(bare.get(), rays)); });
    kept.add([&] { scanner.render(kCamera, view(), scan); });
    fresh.add([&] { benchmark::DoNotOptimize(scanner.render(kCamera, view())); });
  }
  state.counters["a_packets_Mrays/s"] = kMegarays / median(packets.wall);
  state.counters["b_single_Mrays/s"] = kMegarays / median(singles.wall);
  state.counters["c_render_Mrays/s"] = kMegarays / median(kept.wall);
  state.counters["c/a"] = speed_ratio(kept.wall, packets.wall);
  state.counters["c/b"] = speed_ratio(kept.wall, singles.wall);
  state.counters["c/a_in_cpu"] = speed_ratio(kept.processor, packets.processor);
  state.counters["c/b_in_cpu"] = speed_ratio(kept.processor, singles.processor);
  state.counters["d_new_images/a"] = speed_ratio(fresh.wall, packets.wall);
  state.counters["d_new_images/a_in_cpu"] = speed_ratio(fresh.processor, packets.processor);
}
BENCHMARK(BM_Rendering)->Unit(benchmark::kMillisecond)->MinTime(5.0)->UseRealTime();

}  // namespace
}  // namespace dofusion

BENCHMARK_MAIN();
