// Reads the files of a BOP dataset without any of the project's code.
#pragma once

#include <array>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dofusion::bop {

std::string six(int number);  // six digits
nlohmann::json read_json(const std::filesystem::path& file);
std::set<std::string> keys(const nlohmann::json& object);
std::set<std::string> names_in(const std::filesystem::path& folder);

// Three numbers, or nine row by row.
Eigen::Vector3d vector(const nlohmann::json& values);
Eigen::Matrix3d matrix(const nlohmann::json& values);

// Millimetres.
struct Model {
  std::vector<Eigen::Vector3d> vertices, normals;
  std::vector<std::array<int, 3>> triangles;
};

// PLY in ASCII, with the vertices' normals.
Model read_ply(const std::filesystem::path& file);

// An organised PCD file, binary_compressed: all x, then all y, then all z, packed by LZF.
std::vector<float> read_pcd(const std::filesystem::path& file, int width, int height);

}  // namespace dofusion::bop
