// The scanner of geoms against MuJoCo's own rays.
#include <cmath>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include "perception/geom_rays.h"
#include "perception/geom_scanner.h"
#include "stability/files.h"
#include "stability/mjcf_scene.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

constexpr double kAgree = 1e-5;     // metres
constexpr double kSideways = 2e-6;  // metres a metre of distance: Embree finds meshes with rays of floats

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(engine_); }
  Vector3d direction() {
    std::normal_distribution<double> normal;
    return Vector3d(normal(engine_), normal(engine_), normal(engine_)).normalized();
  }

 private:
  std::mt19937_64 engine_;
};

// MuJoCo's model and state of a file, at its start.
class Truth {
 public:
  explicit Truth(const std::string& path) {
    char error[1000] = "";
    model_.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
    if (!model_) throw std::runtime_error(error);
    data_.reset(mj_makeData(model_.get()));
    mj_kinematics(model_.get(), data_.get());
  }
  struct Answer {
    double distance;
    int geom;  // -1: nothing
  };
  // As the scanner shows: geoms of groups 0 to 2.
  Answer ray(const Vector3d& origin, const Vector3d& direction) const {
    const mjtByte groups[mjNGROUP] = {1, 1, 1, 0, 0, 0};
    Answer answer{0.0, -1};
    answer.distance = mj_ray(model_.get(), data_.get(), origin.data(), direction.data(), groups, 1, -1, &answer.geom);
    return answer;
  }
  // Whether a ray a little beside this one gets another answer: it passes an edge or a silhouette.
  bool at_an_edge(const Vector3d& origin, const Vector3d& direction, const Answer& answer) const {
    const Vector3d u = direction.unitOrthogonal(), v = direction.cross(u);
    const double reach = kSideways * std::max(1.0, answer.distance);
    for (int k = 0; k < 8; ++k) {
      const double angle = k * M_PI / 4.0;
      const Answer beside = ray(origin + reach * (std::cos(angle) * u + std::sin(angle) * v), direction);
      if (beside.geom != answer.geom || std::abs(beside.distance - answer.distance) > kAgree) return true;
    }
    return false;
  }
  const mjModel& model() const { return *model_; }

 private:
  struct Delete {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
};

// mj_ray (2.2.2) puts wrong upper edges on the two walls of a height field at x = +-half: straight at them it missed
// the wall below the edge for 22 % and 12 % of rays, and saw one above it for 1 %. Nothing can be compared there.
bool on_x_wall(const MjcfScene& scene, int index, const Vector3d& p_world) {
  if (index < 0) return false;
  const Geom& geom = scene.geoms().at(static_cast<std::size_t>(index));
  if (geom.type != GeomType::kHeightField) return false;
  const Pose T_world_geom = scene.initial_poses().at(static_cast<std::size_t>(geom.body)) * geom.T_body_geom;
  return std::abs(std::abs((T_world_geom.inverse() * p_world).x()) - geom.height_field->half_size.x()) < kAgree;
}

// Rays from `far` metres around `centre` towards points within `near` metres of it.
void compare(const std::string& path, const Vector3d& centre, double near, double far, int count, unsigned seed) {
  const Truth truth(path);
  const MjcfScene scene(path);
  GeomScanner scanner(scene.geoms());
  scanner.set_poses(scene.initial_poses());
  ASSERT_EQ(static_cast<int>(scene.geoms().size()), truth.model().ngeom);
  Random random(seed);
  int hits = 0, edges = 0;
  for (int i = 0; i < count; ++i) {
    const Vector3d origin = centre + far * random.direction();
    const Vector3d target = centre + near * std::cbrt(random.uniform(0, 1)) * random.direction();
    const Vector3d direction = (target - origin).normalized();
    const Truth::Answer expected = truth.ray(origin, direction);
    const auto hit = scanner.cast_ray(origin, direction);
    if (expected.geom >= 0) ++hits;
    const bool same =
        hit ? expected.geom >= 0 && std::abs(hit->distance - expected.distance) < kAgree : expected.geom < 0;
    if (same) continue;
    if (hit && on_x_wall(scene, hit->geom, origin + hit->distance * direction)) continue;
    if (on_x_wall(scene, expected.geom, origin + expected.distance * direction)) continue;
    // The rule: only where mj_ray itself changes its answer for a ray within float's reach.
    EXPECT_TRUE(truth.at_an_edge(origin, direction, expected))
        << path << ": from " << origin.transpose() << " along " << direction.transpose() << " MuJoCo "
        << expected.distance << " geom " << expected.geom << " of type "
        << (expected.geom >= 0 ? truth.model().geom_type[expected.geom] : -1) << ", here "
        << (hit ? hit->distance : -1.0) << " geom " << (hit ? hit->geom : -1);
    if (++edges > 50) break;
  }
  EXPECT_GT(hits, count / 20) << path;
  EXPECT_LE(edges, count / 500) << path;
  testing::Test::RecordProperty("hits", hits);
  testing::Test::RecordProperty("edges", edges);
}

TEST(GeomTruth, FormulasAreMujocosInsideAndOutside) {
  Random random(11);
  const std::vector<std::pair<GeomType, int>> types{
      {GeomType::kPlane, mjGEOM_PLANE},       {GeomType::kSphere, mjGEOM_SPHERE},
      {GeomType::kCapsule, mjGEOM_CAPSULE},   {GeomType::kEllipsoid, mjGEOM_ELLIPSOID},
      {GeomType::kCylinder, mjGEOM_CYLINDER}, {GeomType::kBox, mjGEOM_BOX}};
  const mjtNum position[3] = {0, 0, 0}, rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (const auto& [type, mujocos] : types) {
    int hits = 0, misses = 0, differ = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vector3d size(random.uniform(0.02, 1), random.uniform(0.02, 1), random.uniform(0.02, 1));
      const Vector3d origin = random.uniform(0, 3) * random.direction();
      const Vector3d target = random.uniform(0, 1) * random.direction();
      const Vector3d direction = (target - origin).normalized() * random.uniform(0.1, 5);
      const double expected = mju_rayGeom(position, rotation, size.data(), origin.data(), direction.data(), mujocos);
      const auto hit = intersect(type, size, origin, direction);
      ++(hit ? hits : misses);
      // In units of the direction's length.
      if ((expected >= 0.0) == hit.has_value() && (!hit || std::abs(hit->along - expected) < 1e-7)) continue;
      if (++differ < 4) {
        ADD_FAILURE() << "type " << mujocos << " size " << size.transpose() << " from " << origin.transpose()
                      << " along " << direction.transpose() << ": " << expected << ", here "
                      << (hit ? hit->along : -1.0);
      }
    }
    EXPECT_GT(hits, 1000);
    EXPECT_GT(misses, 1000);
    EXPECT_EQ(differ, 0);
  }
}

// Every type, at random poses, some on bodies that are fixed to others.
std::string every_geom(const TemporaryDirectory& directory, unsigned seed) {
  Random random(seed);
  const auto number = [](double x) { return std::to_string(x) + " "; };
  const auto pose = [&] {
    const Vector3d p = 0.8 * random.direction(), q = random.direction();
    return " pos='" + number(p.x()) + number(p.y()) + number(p.z()) + "' quat='" + number(random.uniform(-1, 1)) +
           number(q.x()) + number(q.y()) + number(q.z()) + "'";
  };
  std::string field;  // MuJoCo's own format: rows, columns, heights
  const std::int32_t sizes[2] = {6, 9};
  field.append(reinterpret_cast<const char*>(sizes), sizeof sizes);
  for (int i = 0; i < 54; ++i) {
    const auto height = static_cast<float>(random.uniform(0, 1));
    field.append(reinterpret_cast<const char*>(&height), sizeof height);
  }
  write_file(directory / "field.bin", field);
  std::string bodies;
  for (const std::string shape :
       {"type='box' size='0.1 0.2 0.15'", "type='sphere' size='0.2'", "type='capsule' size='0.1 0.2'",
        "type='cylinder' size='0.15 0.1'", "type='ellipsoid' size='0.1 0.2 0.3'", "type='mesh' mesh='dart'",
        "type='mesh' mesh='tetra'", "type='plane' size='0.2 0.3 0.1'", "type='hfield' hfield='field'"}) {
    const bool solid = shape.find("plane") == std::string::npos && shape.find("hfield") == std::string::npos;
    bodies += solid ? "<body" + pose() + "><freejoint/><geom " + shape + "/><body" + pose() + "><geom " + shape +
                          pose() + "/></body></body>"
                    : "<geom " + shape + pose() + "/>";
  }
  const std::string path = directory / "every.xml";
  write_file(path,
             "<mujoco><asset><hfield name='field' file='field.bin' size='0.4 0.3 0.2 0.1'/>"
             "<mesh name='tetra' vertex='0 0 0 0.4 0 0 0 0.4 0 0 0 0.4'/>"
             "<mesh name='dart' vertex='-0.3 -0.2 0  0.3 0 0  -0.3 0.2 0  -0.15 0 0  -0.1 0 0.3'"
             " face='0 3 1  1 3 2  0 1 4  1 2 4  2 3 4  3 0 4'/></asset>"
             "<worldbody><geom type='plane' size='0 0 1' pos='0 0 -1.5'/>" +
                 bodies + "</worldbody></mujoco>");
  return path;
}

TEST(GeomTruth, EveryTypeAgreesWithMujocosRays) {
  const TemporaryDirectory directory;
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u})
    compare(every_geom(directory, seed), Vector3d::Zero(), 1.2, 4.0, 6000, seed);
}

TEST(GeomTruth, SampleModelsAgreeWithMujocosRays) {
  const std::filesystem::path samples = "/usr/share/mujoco/model";
  if (!std::filesystem::exists(samples)) GTEST_SKIP() << "Debian's libmujoco-samples is not installed";
  const std::vector<std::string> models{"humanoid/humanoid.xml",
                                        "humanoid100/humanoid100.xml",
                                        "hammock/hammock.xml",
                                        "mug/mug.xml",
                                        "slider_crank/slider_crank.xml",
                                        "tendon_arm/arm26.xml",
                                        "adhesion/active_adhesion.xml",
                                        "composite/cloth.xml",
                                        "composite/rope.xml",
                                        "flag/flag.xml",
                                        "composite/particle.xml",
                                        "composite/softbox.xml",
                                        "composite/grid2pin.xml",
                                        "composite/loop.xml"};
  for (const std::string& model : models) {
    const std::string path = (samples / model).string();
    const Truth truth(path);
    // Around what there is but for planes.
    const Vector3d centre(truth.model().stat.center);
    const double extent = truth.model().stat.extent;
    compare(path, centre, 0.6 * extent, 3.0 * extent, 1000, 7);
  }
}

}  // namespace
}  // namespace dofusion
