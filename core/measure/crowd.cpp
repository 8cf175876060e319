#include "core/measure/crowd.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/measure/figure.h"
#include "core/measure/meshes.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
constexpr double kSpacing = 1.5;
constexpr std::size_t kBuilds = 6;  ///< meshes that figures share before they are posed
constexpr std::size_t kLeastTriangles = 2000, kMostTriangles = 5000;
constexpr std::size_t kThingTriangles = 1500;
constexpr std::size_t kKeys = 9;

/// The angle of one joint while walking: about an axis, around a middle, at a moment of the step.
struct Swing {
  std::uint32_t joint;
  int axis;  ///< 0 x, 1 y, 2 z
  double middle_rad, reach_rad, part_of_step;
};
constexpr std::array kWalk{Swing{1, 1, 0.0, 0.2, 0.0},  Swing{2, 1, 0.0, 0.35, 0.4},
                           Swing{3, 2, -1.0, 0.4, 0.0}, Swing{4, 2, -0.4, 0.4, 0.1},
                           Swing{5, 2, 1.0, 0.4, 0.5},  Swing{6, 2, 0.4, 0.4, 0.6},
                           Swing{7, 0, 0.0, 0.6, 0.0},  Swing{8, 0, 0.5, 0.5, 0.15},
                           Swing{9, 0, 0.0, 0.6, 0.5},  Swing{10, 0, 0.5, 0.5, 0.65}};

class CrowdMaker {
 public:
  CrowdMaker(const CrowdSize& size, std::uint64_t seed) : size_(size), seed_(seed), random_(seed + 900) {}

  BenchScene run() {
    scene_.name = "crowd";
    data().animations.resize(1);
    data().animations[0].name = "walk";
    make_meshes();
    const std::size_t count = size_.figures + size_.things;
    const auto side = std::size_t(std::ceil(std::sqrt(double(count))));
    std::size_t figures = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t column = i % side, row = i / side;
      const Vec3d at = kSpacing * Vec3d(double(column), 0.0, double(row));
      // Spread evenly among the things.
      const bool is_figure = (i + 1) * size_.figures / count > figures;
      is_figure ? place_figure(at, figures++) : place_thing(at);
    }
    const double extent = kSpacing * double(side);
    scene_.view = {{-0.15 * extent, 0.25 * extent + 1.0, -0.2 * extent}, {0.45 * extent, 0.8, 0.4 * extent}};
    return std::move(scene_);
  }

 private:
  scene::SceneData& data() { return scene_.data; }

  void make_meshes() {
    for (std::size_t b = 0; b < kBuilds; ++b) {
      Figure figure = make_figure(kLeastTriangles + b * (kMostTriangles - kLeastTriangles) / (kBuilds - 1),
                                  random_.uniform(0.9, 1.1));
      data().meshes.push_back(std::make_shared<const mesh::TriangleMesh>(std::move(figure.mesh)));
      data().deformations.push_back(std::move(figure.deformation));
    }
    for (auto& thing : {organic_mesh(kThingTriangles, seed_), tree_mesh(kThingTriangles, seed_)}) {
      data().meshes.push_back(std::make_shared<const mesh::TriangleMesh>(thing));
      data().deformations.emplace_back();
    }
  }

  void place_thing(const Vec3d& at) {
    const auto mesh = std::uint32_t(kBuilds + random_.below(2));
    const Mat3d linear = random_.uniform(0.4, 0.7) * random_.rotation();
    data().instances.push_back({.name = {}, .world_from_object = {linear, at}, .mesh_id = mesh});
  }

  std::uint32_t add_node(std::string name, std::uint32_t parent, const Trs& trs) {
    scene::Node& node = data().nodes.emplace_back();
    node.name = std::move(name);
    node.parent = parent;
    node.trs = trs;
    node.local = affine_from_trs(trs);
    return std::uint32_t(data().nodes.size() - 1);
  }

  void place_figure(const Vec3d& at, std::size_t number) {
    const std::string name = "figure " + std::to_string(number);
    const double heading = random_.uniform(0.0, kTwoPi);
    const Trs place{at, {0.0, std::sin(0.5 * heading), 0.0, std::cos(0.5 * heading)}, Vec3d(1.0)};
    const std::uint32_t root = add_node(name, kInvalidId, place);
    const auto first_joint = std::uint32_t(data().nodes.size());
    scene::Skin& skin = data().skins.emplace_back();
    skin.name = name;
    for (const FigureJoint& joint : kFigureJoints) {
      const bool is_root = joint.parent == kInvalidId;
      const Vec3d from = is_root ? Vec3d(0.0) : kFigureJoints[joint.parent].place;
      skin.joints.push_back(add_node(std::string(joint.name), is_root ? root : first_joint + joint.parent,
                                     {joint.place - from}));
      skin.inverse_bind.push_back({Mat3d(1.0), -joint.place});
    }
    scene::InstanceData shown{
        .name = scene::SharedText(name), .world_from_object = {}, .mesh_id = std::uint32_t(number % kBuilds)};
    shown.world_from_object.translation = at;
    shown.node = add_node(name + " body", root, {});
    shown.skin_id = std::uint32_t(data().skins.size() - 1);
    data().instances.push_back(std::move(shown));
    animate(root, first_joint, at);
  }

  /// Steps on the spot's circle, at a moment of the step that is the figure's own.
  void animate(std::uint32_t root, std::uint32_t first_joint, const Vec3d& at) {
    const double begin = random_.uniform();
    add_channel(root, scene::AnimationPath::kTranslation, [&](double part, std::vector<float>& values) {
      const double angle = kTwoPi * (part + begin);
      const Vec3d p = at + 0.3 * Vec3d(std::cos(angle), 0.0, std::sin(angle));
      values.insert(values.end(), {float(p.x), float(p.y), float(p.z)});
    });
    for (const Swing& swing : kWalk) {
      add_channel(first_joint + swing.joint, scene::AnimationPath::kRotation,
                  [&](double part, std::vector<float>& values) {
                    const double turn = kTwoPi * (part + begin + swing.part_of_step);
                    const double half = 0.5 * (swing.middle_rad + swing.reach_rad * std::sin(turn));
                    std::array<float, 4> rotation{0.F, 0.F, 0.F, float(std::cos(half))};
                    rotation[std::size_t(swing.axis)] = float(std::sin(half));
                    values.insert(values.end(), rotation.begin(), rotation.end());
                  });
    }
  }

  /// `value_at(part, values)` appends the value at a part of the loop.
  template <class ValueAt>
  void add_channel(std::uint32_t node, scene::AnimationPath path, const ValueAt& value_at) {
    scene::AnimationChannel& channel = data().animations[0].channels.emplace_back();
    channel.node = node;
    channel.path = path;
    for (std::size_t k = 0; k < kKeys; ++k) {
      const double part = double(k) / double(kKeys - 1);
      channel.times_s.push_back(float(part * kCrowdLoopSeconds));
      value_at(part, channel.values);
    }
  }

  CrowdSize size_;
  std::uint64_t seed_;
  Random random_;
  BenchScene scene_;
};

}  // namespace

CrowdSize crowd_size(double share) {
  const auto part = [share](std::size_t count) {
    return std::max<std::size_t>(2, std::size_t(std::round(share * double(count))));
  };
  const CrowdSize whole;
  return {part(whole.figures), part(whole.things)};
}

BenchScene crowd_scene(const CrowdSize& size, std::uint64_t seed) {
  return CrowdMaker(size, seed).run();
}

}  // namespace gridcast::measure
