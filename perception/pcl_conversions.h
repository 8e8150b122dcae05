// Point clouds of the Point Cloud Library in and out. The one public header that includes PCL.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "perception/camera.h"
#include "perception/image.h"
#include "perception/recovery.h"
#include "perception/segmentation.h"
#include "perception/table.h"
#include "stability/scene.h"

namespace dofusion {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;  // camera frame (x right, y down, z forward), metres

// A PCD or PLY file (cloud_io.cpp, which looks at the header before PCL trusts it). Throws InputError naming the file
// if it is missing, neither .pcd nor .ply, damaged, or without points.
Cloud read_cloud(const std::string& path);

// A PCD file (binary_compressed), organised if the cloud is. Throws InputError naming the file if it cannot be written.
void write_cloud(const Cloud& cloud, const std::string& path);

// An organised cloud, one point a pixel; NaN where there is no reading, or one that is not finite or not positive.
// Throws std::invalid_argument if the image is not of the camera's size or the camera's focal lengths are not positive.
Cloud to_cloud(const DepthImage& depth, const Camera& camera);

// `count` points spread evenly over the object's surface (sample_surface_evenly), with outward unit normals; the
// object's own frame, metres. Same seed, same points.
using SurfaceCloud = pcl::PointCloud<pcl::PointNormal>;
SurfaceCloud to_cloud(const Object& object, int count, std::uint64_t seed = 0);

// A depth image of a cloud, with its camera.
struct CloudView {
  Camera camera;
  DepthImage depth;
};

// An organised cloud keeps its pixels, and its camera is found from the points; an unorganised one (or an organised one
// that no pinhole camera explains) is seen from the origin by a camera of `width` pixels that spans it, the nearest
// point counting in each pixel; it has four times as many rows at most. Points that are not finite or not before the
// camera are left out; nullopt if fewer than three remain.
std::optional<CloudView> view_cloud(const Cloud& cloud, int width = 640);

struct CloudSegmentationOptions {
  DepthSigma sigma;                 // of the points' depth
  double table_band = 3.0;          // sigmas; points nearer to the plane belong to the table
  double min_share = 0.1;           // of the points that must lie on the table's plane
  double cluster_distance = 0.012;  // metres; points nearer to each other belong to one object
  int min_points = 50;              // of an object
};

struct CloudSegmentation {
  Table table;                       // T_world_camera takes the cloud's frame to the world
  std::vector<std::uint8_t> labels;  // one a point: 0 nothing, 1 table, 2, 3, … objects by falling number of points
};

// The table and Euclidean clusters above it, for clouds without an image's order. Objects that touch are not parted.
// nullopt if there is no table. At most 254 objects.
std::optional<CloudSegmentation> segment_cloud(const Cloud& cloud, const CloudSegmentationOptions& options = {});

// The table and the objects as `segment` finds them in the image of view_cloud: parted where surfaces meet in a concave
// edge, so that objects that touch or stand on one another part as well. A point has its pixel's label, unless another
// point hides it there by more than a centimetre: then 0. nullopt if there is no such image, or no table in it.
std::optional<CloudSegmentation> segment_by_convexity(const Cloud& cloud, const SegmentationOptions& options = {});

// The points with their labels, organised if the cloud is; for PCL's viewers and filters. Throws std::invalid_argument
// unless there is one label a point.
using LabelledCloud = pcl::PointCloud<pcl::PointXYZL>;
LabelledCloud labelled(const Cloud& cloud, const std::vector<std::uint8_t>& labels);

}  // namespace dofusion
