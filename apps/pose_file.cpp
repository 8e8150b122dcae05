#include "apps/pose_file.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

constexpr double kRounding = 1e-3;  // of a matrix element that was printed with few digits

bool is_number_row(const json& row) {
  if (!row.is_array() || row.size() != 4) return false;
  return std::all_of(row.begin(), row.end(), [](const json& value) { return value.is_number(); });
}

Pose rigid(const json& rows, const std::string& place) {
  if (!rows.is_array() || rows.size() != 4 || !std::all_of(rows.begin(), rows.end(), is_number_row))
    throw InputError(place + ": must be 4 rows of 4 numbers");
  Eigen::Matrix4d matrix;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) matrix(r, c) = rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)].get<double>();
  }
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  const bool last_row = (matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < kRounding;
  if (!matrix.allFinite() || !last_row || (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > kRounding ||
      R.determinant() < 0.0)
    throw InputError(place + ": is no rigid motion; its upper left 3 x 3 must be a rotation, its last row 0 0 0 1");
  return make_pose(Eigen::Quaterniond(R).normalized().toRotationMatrix(), matrix.topRightCorner<3, 1>());
}

}  // namespace

NamedPose read_pose(const std::string& path, const std::vector<std::string>& names) {
  const json file = json::parse(read_file(path), nullptr, /*allow_exceptions=*/false);
  if (file.is_discarded()) throw InputError(path + ": not valid JSON; expected a pose as 4 x 4 numbers");
  if (file.is_array()) return {"", rigid(file, path)};
  std::string wanted;
  for (const std::string& name : names) {
    if (file.is_object() && file.contains(name)) return {name, rigid(file[name], path + ": " + name)};
    wanted += (wanted.empty() ? "" : " or ") + name;
  }
  throw InputError(path + ": expected " + wanted + " as 4 rows of 4 numbers");
}

}  // namespace dofusion
