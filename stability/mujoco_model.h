// MuJoCo's handles, owned. Private to stability: nothing else sees MuJoCo.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace dofusion {

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData, DataDeleter>;

// Compiles MJCF text. Throws std::runtime_error with MuJoCo's reason.
ModelPtr compile_mjcf(const std::string& text);

// Compiles an MJCF or URDF file with whatever it includes. Throws InputError naming the file, with MuJoCo's reason, or
// that MuJoCo crashes on it: a child process tries the file first (stability/mjcf_trial.h).
ModelPtr load_mjcf(const std::string& path);

// What MuJoCo gave up with in the middle of a call; the mjData is of no use until it is reset.
class MujocoError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Each throws MujocoError, make_data if there is no memory for it, the others if the model's `nstack` is too small.
DataPtr make_data(const mjModel& model);
void step(const mjModel& model, mjData& data);
void collide(const mjModel& model, mjData& data);

// Control characters and runs of white space become one space; none at the ends.
std::string one_line(const std::string& text);

// A state became infinite, or there were more contacts than there was room for: what followed would be a false
// verdict.
bool has_diverged(const mjData& data);

}  // namespace dofusion
