#include "apps/wishes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "stability/even_samples.h"
#include "stability/files.h"
#include "stability/sdf.h"

namespace dofusion {
namespace {

constexpr int kClearancePoints = 600;       // of each surface; some 3 mm apart on a block
constexpr double kTouchingGap = 5e-4;       // metres: nearer is touching, whatever the simulation's margin says
constexpr std::uint64_t kPointSeed = 0x77697368;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string rectangle(const std::array<double, 4>& r) {
  return number(r[0]) + " " + number(r[1]) + " " + number(r[2]) + " " + number(r[3]);
}

void check_rectangle(const std::string& option, const std::array<double, 4>& r) {
  const bool finite = std::all_of(r.begin(), r.end(), [](double v) { return std::isfinite(v); });
  if (!finite || !(r[0] < r[2]) || !(r[1] < r[3]))
    throw InputError(option + " " + rectangle(r) + ": the first corner must be below the second in both coordinates");
}

BoundingBox world_box(const Object& object, const Pose& T_world_object) {
  TriangleMesh mesh = object.mesh;
  for (Eigen::Vector3d& v : mesh.vertices) v = T_world_object * v;
  return bounding_box(mesh);
}

// Planes through the camera along the rectangle's sides: what is on their positive sides is seen in it.
std::vector<Plane> frustum(const std::array<double, 4>& r, const WishScene& scene) {
  const auto ray = [&](double u, double v) {
    return Eigen::Vector3d(scene.T_world_camera.linear() * unproject(scene.camera, u, v, 1.0));
  };
  const Eigen::Vector3d corners[4] = {ray(r[0], r[1]), ray(r[2], r[1]), ray(r[2], r[3]), ray(r[0], r[3])};
  std::vector<Plane> planes;
  for (int k = 0; k < 4; ++k) {
    Plane plane;  // corners run clockwise as the camera sees them, y down
    plane.normal = corners[k].cross(corners[(k + 1) % 4]).normalized();
    plane.offset = plane.normal.dot(scene.T_world_camera.translation());
    planes.push_back(plane);
  }
  return planes;
}

// Least distance between the surfaces by even points on both.
double gap(const Object& a, const Pose& T_world_a, const Object& b, const Pose& T_world_b) {
  const auto one_way = [](const Object& from, const Object& to, const Pose& T_to_from) {
    const MeshDistance distance(to.mesh);
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& v : from.mesh.vertices) least = std::min(least, distance(T_to_from * v));
    Rng rng = make_rng(kPointSeed);
    for (const SurfaceSample& s : sample_surface_evenly(from.mesh, kClearancePoints, rng)) {
      least = std::min(least, to.sdf ? (*to.sdf)(T_to_from * s.point) : distance(T_to_from * s.point));
    }
    return least;
  };
  const Pose T_a_b = T_world_a.inverse() * T_world_b;
  return std::min(one_way(b, a, T_a_b), one_way(a, b, T_a_b.inverse()));
}

bool touches(const Placement& placement, int object) {
  return std::find(placement.touches.begin(), placement.touches.end(), object) != placement.touches.end();
}

bool is_clear(double clearance, const WishScene& scene, const Placement& placement) {
  for (std::size_t i = 0; i < scene.scene.objects.size(); ++i) {
    if (touches(placement, static_cast<int>(i))) continue;
    const double apart = gap(*scene.scene.objects[i], placement.settled[i], *scene.query, placement.settled.back());
    if (apart > kTouchingGap && apart < clearance) return false;
  }
  return true;
}

}  // namespace

bool Wishes::any() const { return region || image_region || on_object || on_table || clearance || upright; }

void set_on(const std::string& text, Wishes& wishes) {
  if (text == "table") {
    wishes.on_table = true;
    return;
  }
  const bool digits = !text.empty() && text.size() < 4 &&
                      std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
  if (!digits) throw InputError("--on " + text + ": must be table or the number of an object, from 0");
  wishes.on_object = std::stoi(text);
}

Eigen::Vector3d axis_from_string(const std::string& text) {
  const bool minus = !text.empty() && text.front() == '-';
  const std::string name = minus ? text.substr(1) : text;
  for (int d = 0; d < 3; ++d) {
    if (name == std::string(1, static_cast<char>('x' + d))) return (minus ? -1.0 : 1.0) * Eigen::Vector3d::Unit(d);
  }
  throw InputError("--upright " + text + ": must be x, y, z, -x, -y or -z");
}

void check_wishes(const Wishes& wishes, std::size_t objects) {
  if (wishes.region) check_rectangle("--region", *wishes.region);
  if (wishes.image_region) check_rectangle("--image-region", *wishes.image_region);
  if (wishes.on_object && static_cast<std::size_t>(*wishes.on_object) >= objects)
    throw InputError("--on " + std::to_string(*wishes.on_object) + ": " +
                     (objects == 0 ? "no object was found on the table"
                                   : "there are the objects 0 to " + std::to_string(objects - 1)) +
                     "; a run without --on shows them in report.html");
}

std::vector<PoseCostPtr> guides(const Wishes& wishes, const WishScene& scene) {
  std::vector<PoseCostPtr> costs;
  if (const auto& r = wishes.region) costs.push_back(within_region({(*r)[0], (*r)[1]}, {(*r)[2], (*r)[3]}));
  if (wishes.image_region) costs.push_back(within_planes(frustum(*wishes.image_region, scene)));
  if (wishes.upright) costs.push_back(upright(*wishes.upright, 0.5 * wishes.upright_deg * M_PI / 180.0));
  Scene others = scene.scene;
  if (wishes.on_object) {
    const auto k = static_cast<std::ptrdiff_t>(*wishes.on_object);
    const BoundingBox box = world_box(*others.objects[static_cast<std::size_t>(k)], others.T_world_object[static_cast<std::size_t>(k)]);
    costs.push_back(within_region(box.min.head<2>(), box.max.head<2>()));
    // Over most of the object's height; how far above it depends on how the query lies.
    costs.push_back(within_planes({{Eigen::Vector3d::UnitZ(), box.min.z() + 0.8 * (box.max.z() - box.min.z())}}));
    others.objects.erase(others.objects.begin() + k);
    others.T_world_object.erase(others.T_world_object.begin() + k);
  }
  if (wishes.clearance && (wishes.on_object || wishes.on_table) && !others.objects.empty())
    costs.push_back(keep_clear(others, *scene.query, *wishes.clearance));
  return costs;
}

std::optional<Eigen::Vector2d> wished_centre(const Wishes& wishes, const WishScene& scene) {
  if (wishes.on_object) {
    const auto k = static_cast<std::size_t>(*wishes.on_object);
    return Eigen::Vector2d(scene.scene.T_world_object[k].translation().head<2>());
  }
  if (const auto& r = wishes.region) return Eigen::Vector2d(0.5 * ((*r)[0] + (*r)[2]), 0.5 * ((*r)[1] + (*r)[3]));
  if (const auto& r = wishes.image_region) {
    const Eigen::Vector3d ray = scene.T_world_camera.linear() *
                                unproject(scene.camera, 0.5 * ((*r)[0] + (*r)[2]), 0.5 * ((*r)[1] + (*r)[3]), 1.0);
    const Eigen::Vector3d eye = scene.T_world_camera.translation();
    if (ray.z() < 0.0) return Eigen::Vector2d((eye - ray * eye.z() / ray.z()).head<2>());
  }
  return std::nullopt;
}

void steer(const Wishes& wishes, const WishScene& scene, PlacementOptions& options) {
  options.guides = guides(wishes, scene);
  options.centre = wished_centre(wishes, scene);
  if (options.start && !options.centre) options.centre = options.start->translation().head<2>();
  if (wishes.on_object) options.anchor = static_cast<std::size_t>(*wishes.on_object);
  if (options.anchor || !options.centre || scene.scene.objects.empty()) return;
  const std::vector<Pose>& poses = scene.scene.T_world_object;
  const auto distance = [&](const Pose& pose) { return (pose.translation().head<2>() - *options.centre).norm(); };
  const auto nearest = std::min_element(poses.begin(), poses.end(),
                                        [&](const Pose& a, const Pose& b) { return distance(a) < distance(b); });
  options.anchor = static_cast<std::size_t>(nearest - poses.begin());
}

std::vector<std::string> unmet(const Wishes& wishes, const WishScene& scene, const Placement& placement) {
  std::vector<std::string> names;
  const Pose& pose = placement.T_world_query;
  const Eigen::Vector3d p = pose.translation();
  if (const auto& r = wishes.region) {
    if (p.x() < (*r)[0] || p.y() < (*r)[1] || p.x() > (*r)[2] || p.y() > (*r)[3]) names.emplace_back("region");
  }
  if (wishes.image_region) {
    const std::vector<Plane> sides = frustum(*wishes.image_region, scene);
    if (!std::all_of(sides.begin(), sides.end(), [&](const Plane& s) { return s.normal.dot(p) >= s.offset; }))
      names.emplace_back("image-region");
  }
  const bool on_table = touches(placement, -1);
  if (wishes.on_object && (on_table || !touches(placement, *wishes.on_object)))
    names.push_back("on " + std::to_string(*wishes.on_object));
  if (wishes.on_table && !on_table) names.emplace_back("on table");
  if (wishes.clearance && (placement.settled.empty() || !is_clear(*wishes.clearance, scene, placement)))
    names.emplace_back("clearance");
  if (wishes.upright) {
    const double cosine = (pose.linear() * *wishes.upright).z();
    if (cosine < std::cos(wishes.upright_deg * M_PI / 180.0)) names.emplace_back("upright");
  }
  return names;
}

std::string to_string(const Wishes& wishes) {
  std::string text;
  const auto add = [&](const std::string& wish) { text += (text.empty() ? "--" : " --") + wish; };
  if (wishes.region) add("region " + rectangle(*wishes.region));
  if (wishes.image_region) add("image-region " + rectangle(*wishes.image_region));
  if (wishes.on_object) add("on " + std::to_string(*wishes.on_object));
  if (wishes.on_table) add("on table");
  if (wishes.clearance) add("clearance " + number(*wishes.clearance));
  if (wishes.upright) add("upright");
  return text;
}

}  // namespace dofusion
