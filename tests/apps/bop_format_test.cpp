// Reads datasets that dofusion-scan wrote the way another program would, with OpenCV and JSON alone and a renderer of
// its own, and checks them against BOP's description of the format (bop_toolkit, docs/bop_datasets_format.md). It says
// what every file and key means.
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>

#include <Eigen/Dense>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/bop_files.h"
#include "tests/apps/run_command.h"
#include "tests/apps/silhouette.h"
#include "tests/temporary_directory.h"

namespace dofusion::bop {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void expect_rotation(const Eigen::Matrix3d& R) {
  EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  EXPECT_GT(R.determinant(), 0.0);  // right-handed frames
}

// Distance from a point to a triangle's plane where the point projects into it, else to its edges.
double distance(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                const Eigen::Vector3d& c) {
  const Eigen::Vector3d n = (b - a).cross(c - a).normalized();
  const std::array<Eigen::Vector3d, 3> corners{a, b, c};
  bool inside = true;
  double nearest = kFar;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d &from = corners[k], edge = corners[(k + 1) % 3] - from;
    inside = inside && n.dot(edge.cross(p - from)) >= 0.0;
    const double t = std::min(1.0, std::max(0.0, edge.dot(p - from) / edge.squaredNorm()));
    nearest = std::min(nearest, (p - from - t * edge).norm());
  }
  return inside ? std::abs(n.dot(p - a)) : nearest;
}

double farthest_off(const Model& model, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  double farthest = 0.0;
  for (const Eigen::Vector3d& v : model.vertices) {
    double nearest = kFar;
    for (const auto& i : model.triangles) {
      nearest =
          std::min(nearest, distance(R * v + t, model.vertices[i[0]], model.vertices[i[1]], model.vertices[i[2]]));
    }
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

struct Box {
  int u0 = 1 << 20, v0 = 1 << 20, u1 = -(1 << 20), v1 = -(1 << 20);
  long pixels = 0;
  void add(int u, int v) {
    u0 = std::min(u0, u), v0 = std::min(v0, v), u1 = std::max(u1, u), v1 = std::max(v1, v);
    ++pixels;
  }
  // x, y of the first pixel, width, height; -1 four times where there is none
  std::array<int, 4> bop() const {
    return pixels == 0 ? std::array<int, 4>{-1, -1, -1, -1} : std::array<int, 4>{u0, v0, u1 - u0 + 1, v1 - v0 + 1};
  }
};

void expect_near(const std::array<int, 4>& found, const json& wanted, int tolerance) {
  ASSERT_EQ(wanted.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(found[k], wanted[k].get<int>(), tolerance) << wanted;
}

class Dataset {
 public:
  Dataset(const fs::path& folder, bool exact_depth, bool clouds)
      : folder_(folder), exact_depth_(exact_depth), clouds_(clouds) {
    EXPECT_EQ(names_in(folder), (std::set<std::string>{"camera.json", "models", "test"}));
  }

  // camera.json: of the sensor, for simulation; scene_camera.json has each image's.
  void check_camera() {
    camera_ = read_json(folder_ / "camera.json");
    EXPECT_EQ(keys(camera_), (std::set<std::string>{"cx", "cy", "depth_scale", "fx", "fy", "height", "width"}));
    view_.width = camera_["width"].get<int>();
    view_.height = camera_["height"].get<int>();
    view_.K << camera_["fx"].get<double>(), 0, camera_["cx"].get<double>(), 0, camera_["fy"].get<double>(),
        camera_["cy"].get<double>(), 0, 0, 1;
  }

  // models/obj_<id>.ply in mm; models_info.json: by id, extents and symmetries. Returns how many models are symmetric.
  int check_models() {
    const json infos = read_json(folder_ / "models/models_info.json");
    std::set<std::string> files{"models_info.json"};
    int symmetric = 0;
    for (const auto& [id, info] : infos.items()) {
      SCOPED_TRACE("model " + id);
      const std::string file = "obj_" + six(std::stoi(id)) + ".ply";
      files.insert(file);
      const Model& model = models_[std::stoi(id)] = read_ply(folder_ / "models" / file);
      check_extents(model, info);
      check_symmetries(model, info);
      if (info.contains("symmetries_discrete") || info.contains("symmetries_continuous")) ++symmetric;
    }
    EXPECT_EQ(names_in(folder_ / "models"), files);
    return symmetric;
  }

  // Returns the number of images.
  int check_scenes() {
    int images = 0, scene = 0;
    const std::set<std::string> scenes = names_in(folder_ / "test");
    for (const std::string& name : scenes) {
      EXPECT_EQ(name, six(scene++));
      SCOPED_TRACE("scene " + name);
      images += check_scene(folder_ / "test" / name);
    }
    return images;
  }

 private:
  static void check_extents(const Model& model, const json& info) {
    double diameter = 0.0;  // the largest distance between two vertices
    Eigen::Vector3d low = model.vertices.front(), high = low;
    for (const Eigen::Vector3d& v : model.vertices) {
      low = low.cwiseMin(v);
      high = high.cwiseMax(v);
      for (const Eigen::Vector3d& w : model.vertices) diameter = std::max(diameter, (v - w).norm());
    }
    // The PLY file holds nine digits.
    EXPECT_NEAR(info["diameter"].get<double>(), diameter, 1e-5);
    const std::array<std::string, 3> axes{"x", "y", "z"};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      EXPECT_NEAR(info["min_" + axes[k]].get<double>(), low[i], 1e-5);
      EXPECT_NEAR(info["size_" + axes[k]].get<double>(), high[i] - low[i], 1e-5);
    }
    for (const Eigen::Vector3d& n : model.normals) EXPECT_NEAR(n.norm(), 1.0, 1e-4);
  }

  // symmetries_discrete: 4 x 4 matrices row by row, translation in mm, without the identity; symmetries_continuous: all
  // rotations about an axis through `offset` (mm). To 1 % of the diameter each maps the model onto itself.
  static void check_symmetries(const Model& model, const json& info) {
    const double tolerance = 0.01 * info["diameter"].get<double>() + 1e-4;
    for (const json& values : info.value("symmetries_discrete", json::array())) {
      ASSERT_EQ(values.size(), 16u);
      Eigen::Matrix4d T;
      for (int k = 0; k < 16; ++k) T(k / 4, k % 4) = values[static_cast<std::size_t>(k)].get<double>();
      EXPECT_EQ(T.row(3), Eigen::RowVector4d(0, 0, 0, 1));
      expect_rotation(T.topLeftCorner<3, 3>());
      EXPECT_GT((T.topLeftCorner<3, 3>() - Eigen::Matrix3d::Identity()).norm(), 0.1);
      EXPECT_LE(farthest_off(model, T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()), tolerance);
    }
    for (const json& symmetry : info.value("symmetries_continuous", json::array())) {
      EXPECT_EQ(keys(symmetry), (std::set<std::string>{"axis", "offset"}));
      const Eigen::Vector3d axis = vector(symmetry["axis"]), offset = vector(symmetry["offset"]);
      EXPECT_NEAR(axis.norm(), 1.0, 1e-9);
      for (const double angle : {0.1, 1.0, 2.3}) {
        const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
        EXPECT_LE(farthest_off(model, R, offset - R * offset), tolerance);
      }
    }
  }

  int check_scene(const fs::path& folder) const {
    std::set<std::string> names{
        "depth", "mask", "mask_visib", "rgb", "scene_camera.json", "scene_gt.json", "scene_gt_info.json"};
    if (clouds_) names.insert("pcd");
    EXPECT_EQ(names_in(folder), names);
    const json cameras = read_json(folder / "scene_camera.json"), truth = read_json(folder / "scene_gt.json"),
               info = read_json(folder / "scene_gt_info.json");
    EXPECT_EQ(keys(cameras), keys(truth));
    EXPECT_EQ(keys(cameras), keys(info));
    std::set<std::string> pictures, masks;
    for (const auto& [image, camera] : cameras.items()) {
      SCOPED_TRACE("image " + image);
      const std::string name = six(std::stoi(image));
      pictures.insert(name + ".png");
      for (std::size_t i = 0; i < truth[image].size(); ++i) {
        masks.insert(name + "_" + six(static_cast<int>(i)) + ".png");
      }
      check_image(folder, name, camera, truth[image], info[image]);
    }
    EXPECT_EQ(names_in(folder / "rgb"), pictures);
    EXPECT_EQ(names_in(folder / "depth"), pictures);
    EXPECT_EQ(names_in(folder / "mask"), masks);
    EXPECT_EQ(names_in(folder / "mask_visib"), masks);
    return static_cast<int>(cameras.size());
  }

  cv::Mat picture(const fs::path& file, int type) const {
    const cv::Mat read = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(read.type(), type) << file;
    EXPECT_EQ(read.cols, view_.width) << file;
    EXPECT_EQ(read.rows, view_.height) << file;
    return read;
  }

  void check_image(const fs::path& folder, const std::string& name, const json& camera, const json& truth,
                   const json& info) const {
    EXPECT_EQ(keys(camera), (std::set<std::string>{"cam_K", "cam_R_w2c", "cam_t_w2c", "depth_scale"}));
    EXPECT_EQ(matrix(camera["cam_K"]), view_.K);
    EXPECT_EQ(camera["depth_scale"], camera_["depth_scale"]);  // value * depth_scale = mm
    expect_rotation(matrix(camera["cam_R_w2c"]));
    picture(folder / "rgb" / (name + ".png"), CV_8UC3);
    const cv::Mat depth = picture(folder / "depth" / (name + ".png"), CV_16UC1);
    ASSERT_EQ(truth.size(), info.size());
    std::vector<Silhouette> silhouettes;
    std::vector<cv::Mat> visible;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      SCOPED_TRACE("object " + std::to_string(i));
      EXPECT_EQ(keys(truth[i]), (std::set<std::string>{"cam_R_m2c", "cam_t_m2c", "obj_id"}));
      expect_rotation(matrix(truth[i]["cam_R_m2c"]));
      silhouettes.emplace_back(models_.at(truth[i]["obj_id"].get<int>()), matrix(truth[i]["cam_R_m2c"]),
                               vector(truth[i]["cam_t_m2c"]), view_);
      const std::string mask = name + "_" + six(static_cast<int>(i)) + ".png";
      visible.push_back(picture(folder / "mask_visib" / mask, CV_8UC1));
      check_object(picture(folder / "mask" / mask, CV_8UC1), visible.back(), depth, silhouettes.back(), info[i]);
    }
    check_against_rendering(camera, depth, silhouettes, visible);
    if (clouds_) check_cloud(folder / "pcd" / (name + ".pcd"), depth);
  }

  // mask: 255 where the object would be seen alone; mask_visib: where it is seen; 0 elsewhere.
  void check_object(const cv::Mat& mask, const cv::Mat& visible, const cv::Mat& depth, Silhouette& silhouette,
                    const json& info) const {
    EXPECT_EQ(keys(info), (std::set<std::string>{"bbox_obj", "bbox_visib", "px_count_all", "px_count_valid",
                                                 "px_count_visib", "visib_fract"}));
    Box all, seen, inside;
    long valid = 0, off = 0;
    for (int v = -view_.height; v < 2 * view_.height; ++v) {
      for (int u = -view_.width; u < 2 * view_.width; ++u) {
        const bool hit = silhouette.at(u, v) < kFar;
        if (hit) all.add(u, v);
        if (u < 0 || v < 0 || u >= view_.width || v >= view_.height) continue;
        const int m = mask.at<std::uint8_t>(v, u), s = visible.at<std::uint8_t>(v, u);
        if ((m != 0 && m != 255) || (s != 0 && s != 255) || s > m) {
          ADD_FAILURE() << "mask " << m << ", visible " << s << " at " << u << ", " << v;
          return;
        }
        off += (m == 255) != hit;
        if (m == 255) inside.add(u, v);
        if (m == 255 && depth.at<std::uint16_t>(v, u) > 0) ++valid;
        if (s == 255) seen.add(u, v);
      }
    }
    // Rays through an edge may hit in single precision and miss in double.
    EXPECT_LE(off, kEdgePixels);
    EXPECT_NEAR(info["px_count_all"].get<double>(), static_cast<double>(all.pixels), kEdgePixels);
    EXPECT_GE(info["px_count_all"].get<long>(), inside.pixels);
    EXPECT_EQ(info["px_count_visib"].get<long>(), seen.pixels);
    EXPECT_EQ(info["px_count_valid"].get<long>(), valid);
    EXPECT_EQ(info["visib_fract"].get<double>(), static_cast<double>(seen.pixels) / info["px_count_all"].get<double>());
    expect_near(all.bop(), info["bbox_obj"], 1);
    expect_near(seen.bop(), info["bbox_visib"], 0);
  }

  // Models at their poses and the table, the plane z = 0 of the world, drawn afresh.
  void check_against_rendering(const json& camera, const cv::Mat& depth, std::vector<Silhouette>& silhouettes,
                               const std::vector<cv::Mat>& visible) const {
    const Eigen::Matrix3d R = matrix(camera["cam_R_w2c"]);
    const Eigen::Vector3d t = vector(camera["cam_t_w2c"]), up = R.col(2);  // the table's normal and a point of it
    const double scale = camera["depth_scale"].get<double>();
    const Eigen::Matrix3d K_inverse = view_.K.inverse();
    long labels_off = 0, depths_off = 0;
    for (int v = 0; v < view_.height; ++v) {
      for (int u = 0; u < view_.width; ++u) {
        const double to_table = up.dot(t) / up.dot(K_inverse * Eigen::Vector3d(u, v, 1.0));
        const Eigen::Vector3d on_table = R.transpose() * (to_table * (K_inverse * Eigen::Vector3d(u, v, 1.0)) - t);
        // The table is four metres long and wide.
        const bool is_table = to_table > 0.0 && on_table.head<2>().cwiseAbs().maxCoeff() < 2000.0;
        double z = is_table ? to_table : kFar;
        int object = -1, labelled = -1;
        for (std::size_t i = 0; i < silhouettes.size(); ++i) {
          if (silhouettes[i].at(u, v) < z) {
            z = silhouettes[i].at(u, v);
            object = static_cast<int>(i);
          }
          if (visible[i].at<std::uint8_t>(v, u) == 255) {
            EXPECT_EQ(labelled, -1) << "two objects are seen in one pixel";
            labelled = static_cast<int>(i);
          }
        }
        if (object != labelled) {
          ++labels_off;
          continue;
        }
        // Half a step, and a hundredth of a millimetre for single precision; 16 bits end at 6.5 m.
        const double read = scale * depth.at<std::uint16_t>(v, u);
        if (z < 6500.0 ? std::abs(read - z) > 0.5 * scale + 0.01 : read > 0.0) ++depths_off;
      }
    }
    // Where objects touch or stand on the table two surfaces lie at one depth.
    EXPECT_LE(labels_off, kEdgePixels);
    if (exact_depth_) {
      EXPECT_LE(depths_off, kEdgePixels);
    }
  }

  // Organised points as floats in metres in the camera's frame, NaN where the depth image has no reading.
  void check_cloud(const fs::path& file, const cv::Mat& depth) const {
    const std::vector<float> values = read_pcd(file, view_.width, view_.height);
    const std::size_t points = depth.total();
    ASSERT_EQ(values.size(), 3 * points);
    const double scale = camera_["depth_scale"].get<double>() / 1000.0;
    const Eigen::Matrix3d K_inverse = view_.K.inverse();
    for (std::size_t i = 0; i < points; ++i) {
      const int u = static_cast<int>(i) % view_.width, v = static_cast<int>(i) / view_.width;
      const float x = values[i], y = values[points + i], z = values[2 * points + i];
      if (depth.at<std::uint16_t>(v, u) == 0) {
        ASSERT_TRUE(std::isnan(x) && std::isnan(y) && std::isnan(z));
        continue;
      }
      const Eigen::Vector3d ray = K_inverse * Eigen::Vector3d(u, v, 1.0);
      // The file has the view's depth before it was rounded to steps of the image.
      ASSERT_NEAR(z, depth.at<std::uint16_t>(v, u) * scale, 0.51 * scale);
      ASSERT_NEAR(x / z, ray.x(), 1e-5);
      ASSERT_NEAR(y / z, ray.y(), 1e-5);
    }
  }

  static constexpr long kEdgePixels = 3;  // an image

  fs::path folder_;
  bool exact_depth_, clouds_;
  json camera_;
  View view_;
  std::map<int, Model> models_;
};

TEST(BopFormat, FiftyImagesOfBlocks) {
  const TemporaryDirectory directory;
  expect_success(run_command("dofusion-scan",
                             {"--task", "unstructured", "--objects", "3", "--count", "10", "--cameras", "5", "--sensor",
                              "none", "--size", "320", "240", "--seed", "77", "--pcd", "--out", directory / "bop"}));
  Dataset dataset(directory / "bop", true, true);
  dataset.check_camera();
  EXPECT_GT(dataset.check_models(), 0);
  EXPECT_EQ(dataset.check_scenes(), 50);
}

TEST(BopFormat, NoisyImagesOfGeneralShapes) {
  const TemporaryDirectory directory;
  expect_success(run_command(
      "dofusion-scan", {"--task", "unstructured", "--objects", "2", "--shapes", "general", "--count", "12", "--sensor",
                        "kinect", "--size", "320", "240", "--seed", "78", "--out", directory / "bop"}));
  Dataset dataset(directory / "bop", false, false);
  dataset.check_camera();
  EXPECT_GT(dataset.check_models(), 0);
  EXPECT_EQ(dataset.check_scenes(), 12);
}

}  // namespace
}  // namespace dofusion::bop
