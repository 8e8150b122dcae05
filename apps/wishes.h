// What a user asks of a placement beside that it stands: as costs that steer the sampler, and as tests of what came out.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "apps/placement.h"
#include "diffusion/guidance.h"
#include "perception/camera.h"

namespace dofusion {

struct Wishes {
  std::optional<std::array<double, 4>> region;        // x0 y0 x1 y1, metres, world: the query's centre of mass lies in it
  std::optional<std::array<double, 4>> image_region;  // u0 v0 u1 v1, pixels: it is seen there by the first camera
  std::optional<int> on_object;                       // rests on this object, and not on the table
  bool on_table = false;                              // touches the table
  std::optional<double> clearance;                    // metres to every object that it does not touch
  std::optional<Eigen::Vector3d> upright;             // this direction of the query, own frame, points up …
  double upright_deg = 10.0;                          // … to so many degrees

  bool any() const;
};

// "table" or the number of an object. Throws InputError.
void set_on(const std::string& text, Wishes& wishes);
// x, y, z, or one of these with a minus. Throws InputError.
Eigen::Vector3d axis_from_string(const std::string& text);

// Throws InputError if no placement can be meant: a region without extent, an object that was not recovered.
void check_wishes(const Wishes& wishes, std::size_t objects);

struct WishScene {
  Scene scene;
  ObjectPtr query;
  Camera camera;  // of the first image
  Pose T_world_camera = Pose::Identity();
};

// Costs for the sampler. Clearance steers only where it is known what the query rests on: with on_table or on_object.
std::vector<PoseCostPtr> guides(const Wishes& wishes, const WishScene& scene);

// Steers the sampler's options towards what is wished: the costs above, where the search begins, what it looks at.
void steer(const Wishes& wishes, const WishScene& scene, PlacementOptions& options);

// Where the search is best begun: the middle of what is asked for; nullopt if nothing says where.
std::optional<Eigen::Vector2d> wished_centre(const Wishes& wishes, const WishScene& scene);

// The wishes that a placement, as settled, does not meet, by their options' names: "region", "on 2", ….
std::vector<std::string> unmet(const Wishes& wishes, const WishScene& scene, const Placement& placement);

// "--region 0 0 0.1 0.1 --on table".
std::string to_string(const Wishes& wishes);

}  // namespace dofusion
