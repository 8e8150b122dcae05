#include "stability/shape_families.h"

#include <map>
#include <set>

#include <gtest/gtest.h>

#include "stability/convex_parts.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

constexpr int kDraws = 50;

std::vector<ObjectPtr> draws(const std::string& name, int count = kDraws) {
  std::vector<ObjectPtr> objects;
  for (int i = 0; i < count; ++i) {
    Rng rng = make_rng(7, static_cast<std::uint64_t>(i));
    objects.push_back(draw_shape(shape_family_kind_from_string(name), rng));
  }
  return objects;
}

Eigen::Vector3d edges_of(const TriangleMesh& mesh) {
  const BoundingBox box = bounding_box(mesh);
  return box.max - box.min;
}

TEST(ShapeFamilies, EveryDrawIsAClosedSolidOfTheNominalDiameter) {
  for (const std::string& name : shape_family_names()) {
    for (const ObjectPtr& object : draws(name)) {
      EXPECT_EQ(object->name, name);
      EXPECT_TRUE(is_closed(object->mesh)) << name;
      EXPECT_NEAR(object->diameter, kShapeDiameter, 1e-12) << name;
      EXPECT_LT(centre_of_mass(object->mesh).norm(), 1e-12) << name;
      if (object->kind == SolidKind::kCylinder) continue;  // its figures are those of the round one
      EXPECT_NEAR(object->volume / volume(object->mesh), 1.0, 1e-12) << name;
      EXPECT_LT((object->inertia - inertia(object->mesh)).norm(), 1e-12 * object->inertia.norm()) << name;
    }
  }
  EXPECT_NEAR(kShapeDiameter, make_block("cube")->diameter, 1e-15);
}

TEST(ShapeFamilies, PartsAreConvexAndFillTheMeshWithoutOverlap) {
  const std::map<std::string, std::size_t> parts = {{"box", 0},        {"prism", 0}, {"cylinder", 0},
                                                    {"polyhedron", 0}, {"ell", 2},   {"tee", 2},
                                                    {"arch", 3},       {"bowl", 17}, {"mug", 23}};
  for (const std::string& name : shape_family_names()) {
    for (const ObjectPtr& object : draws(name, 10)) {
      EXPECT_EQ(object->parts.size(), parts.at(name)) << name;
      EXPECT_EQ(object->convex, object->parts.empty()) << name;
      double sum = 0.0;
      for (const TriangleMesh& part : object->parts) {
        EXPECT_TRUE(is_closed(part)) << name;
        EXPECT_TRUE(is_convex(part, 1e-9)) << name;
        sum += volume(part);
      }
      if (object->parts.empty()) continue;
      // As much volume as the mesh, and none of it outside: then none of it twice.
      EXPECT_NEAR(sum / object->volume, 1.0, 1e-12) << name;
      const ConvexFit fit = convex_fit(object->mesh, object->parts, 64);
      EXPECT_LT(fit.added, 1e-9) << name;
      EXPECT_LT(fit.missing, 1e-9) << name;
    }
  }
}

TEST(ShapeFamilies, MeshesHaveOneSurfaceWithoutInnerFaces) {
  // Euler's number: 2 for a surface without a handle through it, 0 for the mug, whose handle makes a ring.
  for (const std::string& name : shape_family_names()) {
    for (const ObjectPtr& object : draws(name, 5)) {
      const TriangleMesh mesh = weld(object->mesh);
      const auto euler = static_cast<int>(mesh.vertices.size()) - static_cast<int>(mesh.triangles.size()) / 2;
      EXPECT_EQ(euler, name == "mug" ? 0 : 2) << name;
    }
  }
}

TEST(ShapeFamilies, ProportionsStayInTheirRanges) {
  double most_slender = 1.0;
  for (const ObjectPtr& box : draws("box", 300)) {
    ASSERT_EQ(box->kind, SolidKind::kBox);
    const double aspect = box->box_edges->maxCoeff() / box->box_edges->minCoeff();
    EXPECT_LE(aspect, 8.0 + 1e-9);
    most_slender = std::max(most_slender, aspect);
  }
  EXPECT_GT(most_slender, 6.0);  // log-uniform: one in eight is beyond
  for (const ObjectPtr& cylinder : draws("cylinder")) {
    ASSERT_EQ(cylinder->kind, SolidKind::kCylinder);
    const Eigen::Vector3d edges = edges_of(cylinder->mesh);
    EXPECT_NEAR(edges.x(), edges.y(), 1e-12);
    EXPECT_GE(edges.z() / edges.x(), 0.25 - 1e-9);
    EXPECT_LE(edges.z() / edges.x(), 3.0 + 1e-9);
  }
  std::set<std::size_t> sides;
  for (const ObjectPtr& prism : draws("prism", 200)) sides.insert(prism->mesh.vertices.size() / 2);
  EXPECT_EQ(sides, (std::set<std::size_t>{3, 4, 5, 6, 7, 8}));
  for (const ObjectPtr& polyhedron : draws("polyhedron", 200)) {
    EXPECT_GE(polyhedron->mesh.vertices.size(), 8u);
    EXPECT_LE(polyhedron->mesh.vertices.size(), 24u);
    // No slivers: not flat, and as full as an octahedron (1/6 of its bounding box).
    EXPECT_GT(edges_of(polyhedron->mesh).minCoeff(), 0.25 * kShapeDiameter);
    EXPECT_GT(polyhedron->volume, edges_of(polyhedron->mesh).prod() / 6.0);
  }
}

// A bowl or a mug of 16 sides against the closed form over its own profile, read off the mesh.
TEST(ShapeFamilies, BowlsAndMugsHaveTheVolumeOfTheirProfiles) {
  const double ring_area = 8.0 * std::sin(M_PI / 8.0);  // of a regular polygon of 16 corners and radius 1
  for (const ObjectPtr& bowl : draws("bowl")) {
    const auto& v = bowl->mesh.vertices;
    // Corner 0 of the four rings: outside low, outside rim, inside rim, inside low.
    std::vector<Eigen::Vector2d> profile = {{0, v[0].z()}};
    for (int ring = 0; ring < 4; ++ring) {
      const Eigen::Vector3d& corner = v[1 + 16 * ring];
      profile.emplace_back(corner.head<2>().norm(), corner.z());
    }
    profile.emplace_back(0, v.back().z());
    EXPECT_NEAR(bowl->volume / (ring_area * revolution_moment(profile)), 1.0, 1e-12);
    EXPECT_NEAR(v[0].z(), v[1].z(), 1e-12);  // a flat foot
  }
  for (const ObjectPtr& mug : draws("mug")) {
    // Bottom and wall by parts: the first 17; the rest is the handle, a fraction of the whole.
    double body = 0.0;
    for (int i = 0; i < 17; ++i) body += volume(mug->parts[i]);
    double outer = 0.0, bottom = 1.0, top = -1.0;
    for (const Eigen::Vector3d& v : mug->parts[0].vertices) {
      bottom = std::min(bottom, v.z());
      top = std::max(top, v.z());
      outer = std::max(outer, v.y());
    }
    outer /= std::cos(M_PI / 16.0);  // the corner farthest along y is half a step off the axis
    const BoundingBox box = bounding_box(mug->mesh);
    double inner = outer;  // the least distance of a wall's corner from the axis, which is the middle of part 0
    const Eigen::Vector3d axis = centre_of_mass(mug->parts[0]);
    for (const Eigen::Vector3d& v : mug->parts[1].vertices) inner = std::min(inner, (v - axis).head<2>().norm());
    const double height = box.max.z() - box.min.z();
    EXPECT_NEAR(body / (ring_area *
                        (outer * outer * (top - bottom) + (outer * outer - inner * inner) * (height - (top - bottom)))),
                1.0, 1e-9);
    EXPECT_GT(mug->volume, 1.005 * body);
    EXPECT_LT(mug->volume, 1.4 * body);
  }
}

TEST(ShapeFamilies, TheSeedDecides) {
  for (const std::string& name : shape_family_names()) {
    const auto once = draws(name, 3), again = draws(name, 3);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(once[i]->mesh.vertices, again[i]->mesh.vertices) << name;
      EXPECT_EQ(once[i]->mesh.triangles, again[i]->mesh.triangles) << name;
    }
    EXPECT_NE(once[0]->mesh.vertices, once[1]->mesh.vertices) << name;
  }
}

TEST(ShapeFamilies, PartsFollowAnObjectThatIsScaled) {
  for (const char* name : {"arch", "mug"}) {
    const ObjectPtr object = draws(name, 1).front();
    const ObjectPtr stretched = scaled(*object, {2.0, 0.5, 3.0});
    double sum = 0.0;
    for (const TriangleMesh& part : stretched->parts) sum += volume(part);
    EXPECT_NEAR(sum / object->volume, 3.0, 1e-11) << name;
    EXPECT_NEAR(stretched->volume / object->volume, 3.0, 1e-11) << name;
  }
}

TEST(ShapeFamilies, UnknownNameIsRefusedWithTheChoices) {
  try {
    shape_family_kind_from_string("teapot");
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("polyhedron"), std::string::npos);
  }
  for (const std::string& name : shape_family_names()) EXPECT_EQ(to_string(shape_family_kind_from_string(name)), name);
}

}  // namespace
}  // namespace dofusion
