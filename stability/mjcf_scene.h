// MuJoCo XML (MJCF) files as scenes: any geoms, bodies fixed, free or on joints.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stability/geom.h"
#include "stability/physics.h"
#include "stability/scene.h"

namespace dofusion {

struct SceneBody {
  std::string name;       // "world" is the surroundings; "body <id>" if the file gives none
  bool moves = false;     // on a joint, or part of something that is; MuJoCo's mocap bodies do not
  double diameter = 0.0;  // metres, of what can be touched; infinite with a plane. stability/README.md: how exact
  double mass = 0.0;      // kg, as in the file
};

// A file with its own masses, friction, solver settings and time step. Not to be shared between threads.
class MjcfScene {
 public:
  // `keyframe`: where to start from, the name or number of one of the file's keyframes, positions, speeds and controls;
  // empty: the positions of its bodies, at rest. Throws InputError naming the file, with MuJoCo's reason where it has
  // one: if it, or what it includes, is missing or cannot be built; if it has no geom; if a size, pose, mass, a
  // camera's field of view or the time step makes no sense; if there is no such keyframe.
  explicit MjcfScene(const std::string& path, const std::string& keyframe = "");
  ~MjcfScene();
  MjcfScene(MjcfScene&&) noexcept;
  MjcfScene& operator=(MjcfScene&&) noexcept;

  // Those with a geom, in the file's order.
  const std::vector<SceneBody>& bodies() const;
  // Indices into bodies() of those that move: what SettleResult is about.
  const std::vector<int>& moving() const;
  // One per body: position of its centre of mass, orientation of its frame.
  std::vector<Pose> initial_poses() const;

  // The same with the moving bodies elsewhere, for instance at the poses of a SettleResult: as many as moving(). Throws
  // std::invalid_argument otherwise.
  std::vector<Pose> poses(const std::vector<Pose>& T_world_moving) const;

  // All of the file's, in its order, also those that cannot be touched; skins and sites are none. A geom is at
  // T_world_body * T_body_geom, with its body's pose as in initial_poses() or poses(). Meshes are as MuJoCo keeps them,
  // about their inertial frames (T_body_geom makes up for it), not their hulls. Textures count with their mean colour.
  const std::vector<Geom>& geoms() const;

  // In the file's order. One with a mode other than "fixed" (it tracks or targets something), or on a body that moves
  // but has no geom, not even through what is fixed to it, stays where it is in the state to start from.
  const std::vector<SceneCamera>& cameras() const;

  // With the file's settings until everything that moves rests. Of `options`, the time limit and what rest is count,
  // nothing else. SettleResult is about moving(), with poses as initial_poses; in `touching`, -1 is everything that
  // does not move. Throws InputError naming the file if MuJoCo gives up (<size nstack> too small), or if it would take
  // more than ten million steps. `stop` is asked before every step; once it says true, settling ends there and then as
  // if the time limit were over.
  SettleResult settle(const PhysicsOptions& options = {}, const std::function<bool()>& stop = {}) const;

  // The free bodies as uniform solids on the table z = 0, for the toolkit's own physics, at their initial poses or at
  // those of a SettleResult. Of the file's masses, friction and solver settings nothing remains.
  //   An object is what can be touched of a body with a free joint and of those fixed to it. One box, cylinder or
  // sphere stays what it is, in its geom's frame. Anything else has its body's orientation: one geom is a mesh, several
  // are one mesh of several closed shells with the geoms as its convex parts. Geoms that lie within another one, to a
  // thousandth of the object's diameter, are left out.
  //   Throws InputError naming the file and the body: if something fixed can be touched but for planes at z = 0, or
  // there is no such plane; if there are joints other than free ones, constraints, tendons or actuators; if gravity
  // does not point down; if geoms of an object overlap by more than a thousandth of its volume (they would count
  // twice).
  Scene to_scene() const;
  Scene to_scene(const std::vector<Pose>& T_world_moving) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
