#include "perception/views.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>

#include <gtest/gtest.h>

#include "box_image.h"
#include "perception/known_recovery.h"
#include "perception/seen_surface.h"
#include "perception/unknown_recovery.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

const DepthSigma kSigma{0.0, 1.7e-3};

// Three cameras around the scene, 120 degrees apart.
std::vector<Pose> cameras_around() {
  std::vector<Pose> poses;
  for (int i = 0; i < 3; ++i) {
    const double azimuth = 0.3 + 2.0 * M_PI * i / 3.0;
    poses.push_back(look_at({0.5 * std::cos(azimuth), 0.5 * std::sin(azimuth), 0.45}, {0.0, 0.0, 0.03}));
  }
  return poses;
}

// The cameras know their poses relative to the first one; `labels` are the true ones.
std::vector<View> see(const std::vector<TriangleMesh>& meshes) {
  const std::vector<Pose> poses = cameras_around();
  std::vector<View> views;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    BoxImage image = render_boxes(meshes, test_camera(), poses[i], kSigma, 20 + i);
    views.push_back({image.depth, test_camera(), poses.front().inverse() * poses[i], image.labels});
  }
  return views;
}

TEST(Views, TheTableIsThatOfTheTrueWorldUpToOriginAndYaw) {
  const auto views = on_common_table(see({upright_box({0.05, 0.05, 0.05}, {0, 0, 0.025}, 0.4)}));
  ASSERT_TRUE(views);
  const std::vector<Pose> truth = cameras_around();
  const Pose T_true_found = truth[0] * (*views)[0].T_world_camera.inverse();
  // Some 50,000 readings of 1 mm each: the plane is exact to a few hundredths of a millimetre.
  EXPECT_NEAR(T_true_found.linear().col(2).z(), 1.0, 1e-7);
  EXPECT_NEAR(T_true_found.translation().z(), 0.0, 1e-4);
  for (std::size_t i = 1; i < truth.size(); ++i) {
    EXPECT_TRUE((T_true_found * (*views)[i].T_world_camera).isApprox(truth[i], 1e-9));
  }
  // The optical axis of the first camera meets the table in the origin.
  const Eigen::Vector3d axis = (*views)[0].T_world_camera.linear().col(2);
  const Eigen::Vector3d eye = (*views)[0].T_world_camera.translation();
  EXPECT_LT((eye - axis * eye.z() / axis.z()).norm(), 1e-9);
}

TEST(Views, AViewWithoutATableIsPlacedByTheOthers) {
  std::vector<View> seen = see({upright_box({0.05, 0.05, 0.05}, {0, 0, 0.025}, 0.4)});
  seen[1].depth = DepthImage(test_camera().width, test_camera().height);
  const auto views = on_common_table(seen);
  ASSERT_TRUE(views);
  EXPECT_EQ(views->size(), 3U);
  for (View& view : seen) view.depth = DepthImage(test_camera().width, test_camera().height);
  EXPECT_FALSE(on_common_table(seen));
  EXPECT_THROW(on_common_table({}), std::invalid_argument);
}

// The labels found where the true object is.
std::set<int> labels_where(const LabelImage& truth, const LabelImage& found, int object) {
  std::set<int> labels;
  for (std::size_t p = 0; p < truth.pixels.size(); ++p) {
    if (truth.pixels[p] == kLabelFirstObject + object) labels.insert(found.pixels[p]);
  }
  return labels;
}

TEST(Views, FusedLabelsAreTheSameInAllViews) {
  const std::vector<View> truth = see({upright_box({0.06, 0.05, 0.05}, {-0.05, 0, 0.025}, 0.4),
                                       upright_box({0.04, 0.05, 0.08}, {0.06, 0.01, 0.04}, 0.1)});
  std::vector<View> views = *on_common_table(truth);
  for (std::uint8_t& label : views[1].labels.pixels) {  // the other way round in one view
    if (label >= kLabelFirstObject) label = static_cast<std::uint8_t>(2 * kLabelFirstObject + 1 - label);
  }
  fuse_labels(views);
  for (int object = 0; object < 2; ++object) {
    const std::set<int> first = labels_where(truth[0].labels, views[0].labels, object);
    EXPECT_EQ(first.size(), 1U);
    for (std::size_t i = 1; i < views.size(); ++i) {
      EXPECT_EQ(labels_where(truth[i].labels, views[i].labels, object), first) << i;
    }
  }
}

TEST(Views, ABoxFromThreeSidesIsNearlyExact) {
  const TriangleMesh box = upright_box({0.09, 0.05, 0.06}, {0.01, 0.0, 0.03}, 0.4);
  const auto views = on_common_table(see({box}));
  const std::vector<RecoveredObject> objects = recover_unknown(*views);
  ASSERT_EQ(objects.size(), 1U);
  ASSERT_TRUE(objects[0].object->box_edges);
  Eigen::Vector3d edges = *objects[0].object->box_edges;
  std::sort(edges.begin(), edges.end());
  // Outlines are exact to about a pixel: 1 mm here, on either side.
  EXPECT_LT((edges - Eigen::Vector3d(0.05, 0.06, 0.09)).cwiseAbs().maxCoeff(), 0.003);
  const std::vector<float> seen = seen_shares(objects[0], *views);
  // Three cameras around it have seen all of it but the bottom: that is 2 of 12 triangles.
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 0.0f), 2);
}

TEST(Views, FromOneSideHalfOfABoxIsMadeUp) {
  const TriangleMesh box = upright_box({0.05, 0.05, 0.05}, {0.0, 0.0, 0.025}, 0.4);
  std::vector<View> views = see({box});
  views.resize(1);
  views = *on_common_table(views);
  const std::vector<RecoveredObject> objects = recover_unknown(views);
  ASSERT_EQ(objects.size(), 1U);
  const RecoveredObject& object = objects[0];
  const std::vector<float> seen = seen_shares(object, views);
  ASSERT_EQ(seen.size(), object.object->mesh.triangles.size());
  const Eigen::Vector3d eye = views[0].T_world_camera.translation();
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Eigen::Vector3i& t = object.object->mesh.triangles[i];
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = object.T_world_object * object.object->mesh.vertices[t[k]];
    const Eigen::Vector3d normal = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
    if (normal.dot(eye - corners.col(0)) > 0.0) {
      EXPECT_GT(seen[i], 0.7f) << i;
    } else {
      EXPECT_EQ(seen[i], 0.0f) << i;
    }
  }
}

TEST(Views, ObjFilesMarkWhatWasNeverSeen) {
  const TemporaryDirectory directory;
  const TriangleMesh box = box_mesh({0.05, 0.05, 0.05});
  std::vector<float> shares(box.triangles.size(), 0.5f);
  shares[3] = shares[7] = 0.0f;
  write_seen_obj(box, shares, directory / "box.obj");
  // Readers of materials find both, and those that merge parts the whole solid.
  EXPECT_NEAR(volume(read_solid_mesh(directory / "box.obj")), std::pow(0.05, 3), 1e-10);
  std::istringstream lines(read_file(directory / "box.obj"));
  std::map<std::string, int> faces;
  std::string material, word, line;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "usemtl") words >> material;
    if (word == "f") ++faces[material];
    if (word == "mtllib") {
      EXPECT_EQ(line, "mtllib box.mtl");
    }
  }
  EXPECT_EQ(faces, (std::map<std::string, int>{{"seen", 10}, {"never_seen", 2}}));
  const std::string materials = read_file(directory / "box.mtl");
  for (const char* name : {"newmtl seen\n", "newmtl never_seen\n"}) EXPECT_NE(materials.find(name), std::string::npos);
  EXPECT_THROW(write_seen_obj(box, {1.0f}, directory / "box.obj"), std::invalid_argument);
  EXPECT_THROW(write_seen_obj(box, shares, directory / "none/box.obj"), InputError);
}

TEST(Views, KnownObjectsAreFoundWhereNoSingleViewShowsAllOfThem) {
  // A cube behind a taller box, as the first camera sees it.
  const ObjectPtr cube = make_block("cube"), rectangle = make_block("rectangle");
  const auto placed = [](const Object& object, const Eigen::Vector3d& at) { return translated(object.mesh, at); };
  const Eigen::Vector3d towards = Eigen::Vector3d(std::cos(0.3), std::sin(0.3), 0.0);
  const Eigen::Vector3d at_cube = -0.04 * towards + Eigen::Vector3d(0, 0, 0.025);
  const Eigen::Vector3d at_rectangle = 0.04 * towards + Eigen::Vector3d(0, 0, 0.05);
  const std::vector<View> seen = see({placed(*cube, at_cube), placed(*rectangle, at_rectangle)});
  const auto views = on_common_table(seen);
  const std::vector<RecoveredObject> objects = recover_known(*views, {cube, rectangle});
  ASSERT_EQ(objects.size(), 2U);
  const Pose T_true_found = cameras_around()[0] * (*views)[0].T_world_camera.inverse();
  for (const RecoveredObject& object : objects) {
    const Eigen::Vector3d truth = object.name == "cube" ? at_cube : at_rectangle;
    EXPECT_LT((T_true_found * object.T_world_object.translation() - truth).norm(), 0.001) << object.name;
  }
  EXPECT_NE(objects[0].name, objects[1].name);
}

TEST(Views, WithoutViewsRecoveryThrows) {
  EXPECT_THROW(recover_known(std::vector<View>{}, all_blocks()), std::invalid_argument);
  EXPECT_THROW(recover_unknown(std::vector<View>{}), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
