#include "stability/mjcf.h"

#include <iomanip>
#include <sstream>

namespace dofusion {
namespace {

std::ostream& operator<<(std::ostream& out, const Eigen::Vector3d& v) {
  return out << v.x() << ' ' << v.y() << ' ' << v.z();
}

// Objects and scenes may carry names from files: keep what is safe inside an XML attribute.
std::string xml_safe(std::string text) {
  for (char& c : text) {
    if (c == '<' || c == '>' || c == '&' || c == '"' || c == '\'' || static_cast<unsigned char>(c) < 32) c = '_';
  }
  return text;
}

void write_mesh_asset(std::ostream& out, const TriangleMesh& mesh, std::size_t index, const std::string& file) {
  out << "    <mesh name=\"mesh_" << index << "\"";
  if (!file.empty()) {
    out << " file=\"" << xml_safe(file) << "\"/>\n";
    return;
  }
  out << " vertex=\"";
  for (const Eigen::Vector3d& v : mesh.vertices) out << v << ' ';
  out << "\" face=\"";
  for (const Eigen::Vector3i& t : mesh.triangles) out << t[0] << ' ' << t[1] << ' ' << t[2] << ' ';
  out << "\"/>\n";
}

// MuJoCo gives a mesh at most three contacts with a plane, and a prism that lies on a rectangle rocks about the
// diagonal. So the hull's corners carry the contact with the table, as massless spheres far smaller than any
// tolerance; the mesh itself meets other objects only. Meshes with very many corners keep MuJoCo's own contact.
constexpr double kCornerRadius = 1e-5;
constexpr std::size_t kMostCorners = 128;

bool rests_on_corners(const Object& object) {
  return !object.box_edges && object.mesh.vertices.size() <= kMostCorners;
}

void write_corners(std::ostream& out, const TriangleMesh& mesh) {
  for (const Eigen::Vector3d& v : mesh.vertices) {
    out << "      <geom class=\"corner\" pos=\"" << v << "\"/>\n";
  }
}

const char* colour(std::size_t index) {
  static const char* const colours[] = {"0.35 0.55 0.80 1", "0.90 0.60 0.25 1", "0.45 0.70 0.40 1",
                                        "0.80 0.40 0.40 1", "0.60 0.50 0.75 1", "0.60 0.45 0.35 1"};
  return colours[index % 6];
}

}  // namespace

std::string mjcf_text(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses,
                      const PhysicsOptions& options, const std::vector<std::string>& mesh_files) {
  std::ostringstream out;
  out << std::setprecision(9);
  std::size_t contacts = 16;  // room for 16 an object, or for every corner that may lie on the table
  for (const ObjectPtr& object : objects) {
    contacts += 16 + (rests_on_corners(*object) ? object->mesh.vertices.size() : 0);
  }
  out << "<mujoco model=\"dofusion\">\n"
      << "  <compiler angle=\"radian\"/>\n"
      // Elliptic cones, a high impratio and no-slip iterations keep friction from creeping.
      << "  <option timestep=\"" << options.timestep << "\" cone=\"elliptic\" impratio=\"10\" noslip_iterations=\"4\">\n"
      // A face must rest on more than one point.
      << "    <flag multiccd=\"enable\"/>\n"
      << "  </option>\n"
      << "  <size nconmax=\"" << contacts << "\" njmax=\"" << 4 * contacts << "\" nstack=\"" << 100000 * (1 + objects.size())
      << "\"/>\n"
      << "  <default>\n"
      << "    <geom density=\"" << options.density << "\" friction=\"" << options.friction
      << " 0.005 0.0001\" condim=\"4\" solref=\"" << 2.5 * options.timestep << " 1\" solimp=\"0.95 0.99 0.0005\"/>\n"
      // The table meets boxes (bit 2 of their conaffinity) and corners, objects meet each other.
      << "    <default class=\"corner\"><geom type=\"sphere\" size=\"" << kCornerRadius
      << "\" mass=\"0\" contype=\"0\" conaffinity=\"2\" group=\"3\"/></default>\n"
      << "  </default>\n"
      << "  <visual><global offwidth=\"1280\" offheight=\"960\"/></visual>\n"
      << "  <asset>\n";
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (objects[i]->box_edges) continue;
    write_mesh_asset(out, objects[i]->mesh, i, mesh_files.empty() ? std::string() : mesh_files[i]);
  }
  out << "  </asset>\n"
      << "  <worldbody>\n"
      << "    <light pos=\"0.5 -0.5 1.5\" dir=\"-0.3 0.3 -1\" diffuse=\"0.7 0.7 0.7\"/>\n"
      << "    <geom name=\"table\" type=\"plane\" size=\"0 0 0.05\" contype=\"2\" conaffinity=\"0\" rgba=\"0.8 0.8 0.8 1\"/>\n";
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const PoseArray pose = to_array(poses.empty() ? Pose::Identity() : poses[i]);
    out << "    <body name=\"object_" << i << "\" pos=\"" << pose[0] << ' ' << pose[1] << ' ' << pose[2] << "\" quat=\""
        << pose[3] << ' ' << pose[4] << ' ' << pose[5] << ' ' << pose[6] << "\">\n"
        << "      <freejoint/>\n";
    if (objects[i]->box_edges) {
      out << "      <geom type=\"box\" size=\"" << (*objects[i]->box_edges / 2.0).eval() << "\"";
    } else {
      out << "      <geom type=\"mesh\" mesh=\"mesh_" << i << "\"";
    }
    const bool corners = rests_on_corners(*objects[i]);
    out << " name=\"geom_" << i << "\" contype=\"1\" conaffinity=\"" << (corners ? 1 : 3) << "\" rgba=\"" << colour(i)
        << "\"/>\n";
    if (corners) write_corners(out, objects[i]->mesh);
    out << "    </body>\n";
  }
  out << "  </worldbody>\n"
      << "</mujoco>\n";
  return out.str();
}

}  // namespace dofusion
