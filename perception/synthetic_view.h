// One synthetic depth image of a scene: a viewpoint, an exact scan, the sensor's noise.
#pragma once

#include <optional>
#include <string>

#include "perception/camera.h"
#include "perception/miscalibration.h"
#include "perception/scanner.h"
#include "perception/sensor_noise.h"
#include "stability/random.h"
#include "stability/scene.h"

namespace dofusion {

// 640 x 480, 56 degrees wide, depth in steps of 0.1 mm.
Camera default_camera();

struct ViewpointOptions {
  double distance = 0.7;            // metres from the target
  double min_elevation_deg = 30.0;  // above the table
  double max_elevation_deg = 60.0;
};

// T_world_camera of a camera that looks at `target` from a random azimuth and elevation (uniform over the part of
// the sphere between the two elevations), upright. Throws std::invalid_argument unless the distance is positive and
// 0 <= min <= max < 90.
Pose sample_viewpoint(const Eigen::Vector3d& target, const ViewpointOptions& options, Rng& rng);

// Centre of the box around all the scene's objects; the origin if there is none.
Eigen::Vector3d scene_centre(const Scene& scene);

// From how far away, in metres, the objects are well seen from all sides: the ball around their centre that holds them
// fills three quarters of the image's smaller side. Throws std::invalid_argument if the scene has no object.
double viewing_distance(const Scene& scene, const Camera& camera);

struct SyntheticViewOptions {
  ViewpointOptions viewpoint;
  SensorModel sensor = SensorModel::kRealsense;
  Miscalibration miscalibration;
  double noise_scale = 1.0;  // of the sensor's noise and of the miscalibration
};

struct SyntheticView {
  Pose T_world_camera = Pose::Identity();
  Scan truth;        // exact depth, labels in the order of the scene's objects, normals
  DepthImage depth;  // what the sensor reads
  // What the user takes camera and pose for; none: they are known exactly. The image is what the true camera sees.
  std::optional<CalibratedCamera> believed;
};

// Looks at the scene's centre from a random viewpoint.
SyntheticView make_synthetic_view(const Scene& scene, const Camera& camera, const SyntheticViewOptions& options,
                                  Rng& rng);

// Of what was seen exactly from T_world_camera.
SyntheticView make_synthetic_view(Scan truth, const Camera& camera, const Pose& T_world_camera,
                                  const SyntheticViewOptions& options, Rng& rng);

// Why a camera at this place shows nothing of use: it is under the table, or inside an object. Empty: it does.
std::string viewpoint_problem(const Scene& scene, const Pose& T_world_camera);

// Whether the point lies inside the closed mesh, by the solid angle that its triangles fill.
bool encloses(const TriangleMesh& mesh, const Eigen::Vector3d& point);

}  // namespace dofusion
