// MuJoCo's handles, owned. Private to stability: nothing else sees MuJoCo.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
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

// Compiles an MJCF or URDF file with whatever it includes. Throws InputError naming the file, with MuJoCo's reason.
ModelPtr load_mjcf(const std::string& path);

// Throws std::runtime_error if there is no memory for it.
DataPtr make_data(const mjModel& model);

// A state became infinite, or there were more contacts than there was room for: what followed would be a false
// verdict.
bool has_diverged(const mjData& data);

}  // namespace dofusion
