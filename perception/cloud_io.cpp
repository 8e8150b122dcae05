#include "perception/cloud_io.h"

#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stability/files.h"

namespace dofusion {
namespace {

pcl::PointCloud<pcl::PointXYZ> read_cloud(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such cloud file");
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), ::tolower);
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);  // our own line says what is wrong
  pcl::PointCloud<pcl::PointXYZ> cloud;
  int status = -1;
  try {
    if (extension == ".pcd") {
      status = pcl::PCDReader().read(path, cloud);
    } else if (extension == ".ply") {
      status = pcl::PLYReader().read(path, cloud);
    } else {
      throw InputError(path + ": a cloud must be a .pcd or .ply file");
    }
  } catch (const InputError&) {
    throw;
  } catch (const std::exception&) {
    status = -1;  // PCL throws on some damaged headers and returns a status on others
  }
  if (status < 0 || cloud.empty()) throw InputError(path + ": damaged, or without points");
  return cloud;
}

}  // namespace

DepthImage read_cloud_as_depth(const std::string& path, const Camera& camera) {
  DepthImage depth(camera.width, camera.height, 0.0F);
  bool any = false;
  for (const pcl::PointXYZ& p : read_cloud(path)) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || p.z <= 0.0F) continue;
    const Eigen::Vector2d pixel = project(camera, {p.x, p.y, p.z});
    if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) continue;
    const int column = static_cast<int>(std::lround(pixel.x())), row = static_cast<int>(std::lround(pixel.y()));
    if (!depth.contains(row, column)) continue;
    float& reading = depth.at(row, column);
    if (reading == 0.0F || p.z < reading) reading = p.z;
    any = true;
  }
  if (!any) {
    throw InputError(path + ": no point projects into the camera's image; the cloud must be in the camera's frame (x "
                            "right, y down, z forward, metres)");
  }
  return depth;
}

}  // namespace dofusion
