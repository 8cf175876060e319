#include <algorithm>
#include <cstring>
#include <limits>
#include <set>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <gtest/gtest.h>

#include "core/io/image.h"
#include "core/math/vec.h"
#include "tests/support/random.h"

namespace gridcast::io {
namespace {

class MemoryInput final : public Imf::IStream {
 public:
  explicit MemoryInput(const std::vector<std::byte>& bytes) : IStream("memory"), bytes_(bytes) {}
  bool read(char data[], int count) override {
    EXPECT_LE(position_ + std::uint64_t(count), bytes_.size());
    std::memcpy(data, bytes_.data() + position_, std::size_t(count));
    position_ += std::uint64_t(count);
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  const std::vector<std::byte>& bytes_;
  std::uint64_t position_ = 0;
};

template <class T>
std::vector<T> read_channel(Imf::InputFile& file, const std::string& name, Imf::PixelType type) {
  const Imath::Box2i window = file.header().dataWindow();
  const auto width = std::size_t(window.max.x + 1), height = std::size_t(window.max.y + 1);
  std::vector<T> values(width * height);
  Imf::FrameBuffer frame;
  frame.insert(name, Imf::Slice(type, reinterpret_cast<char*>(values.data()), sizeof(T), sizeof(T) * width));
  file.setFrameBuffer(frame);
  file.readPixels(window.min.y, window.max.y);
  return values;
}

render::Layer random_layer(const std::string& name, std::vector<std::string> channels, std::size_t pixels,
                           test::Random& random) {
  render::Layer layer{name, std::move(channels), {}, {}};
  for (std::size_t i = 0; i < pixels * layer.channels.size(); ++i)
    layer.values.push_back(float(random.uniform(-10.0, 1e6)));
  return layer;
}

render::Film random_film(int width_px, int height_px) {
  test::Random random(test::seed_or(31));
  const std::size_t pixels = std::size_t(width_px) * std::size_t(height_px);
  render::Film film;
  film.width_px = width_px;
  film.height_px = height_px;
  film.exposure = 0.125F;
  film.layers.push_back(random_layer("color", {"R", "G", "B", "A"}, pixels, random));
  film.layers.push_back(random_layer("depth", {"Z"}, pixels, random));
  film.layers.push_back(random_layer("normal", {"X", "Y", "Z"}, pixels, random));
  film.layers[1].values[3] = std::numeric_limits<float>::infinity();
  for (const char* name : {"instance_id", "mesh_id", "primitive_id"}) {
    film.layers.push_back({name, {"id"}, {}, {}});
    for (std::size_t i = 0; i < pixels; ++i) film.layers.back().ids.push_back(unsigned(random.bits()));
    film.layers.back().ids[0] = kInvalidId;
  }
  return film;
}

TEST(Exr, every_layer_comes_back_bit_for_bit) {
  const render::Film film = random_film(67, 41);  // not a multiple of ZIP's 16-line blocks
  const auto bytes = encode_exr(film);
  ASSERT_TRUE(bytes.ok());
  MemoryInput stream(*bytes);
  Imf::InputFile file(stream, 0);
  EXPECT_EQ(file.header().compression(), Imf::ZIP_COMPRESSION);
  EXPECT_EQ(file.header().dataWindow().max, Imath::V2i(66, 40));
  EXPECT_EQ(file.header().typedAttribute<Imf::FloatAttribute>("gridcast:exposure").value(), 0.125F);

  std::size_t channels = 0;
  for (const render::Layer& layer : film.layers) {
    for (std::size_t c = 0; c < layer.channels.size(); ++c, ++channels) {
      const std::string name =
          layer.name == "color" ? layer.channels[c] : layer.name + "." + layer.channels[c];
      const Imf::Channel* channel = file.header().channels().findChannel(name);
      ASSERT_NE(channel, nullptr) << name;
      EXPECT_EQ(channel->type, layer.ids.empty() ? Imf::FLOAT : Imf::UINT) << name;
      if (!layer.ids.empty()) {
        EXPECT_TRUE(std::ranges::equal(read_channel<unsigned>(file, name, Imf::UINT), layer.ids)) << name;
        continue;
      }
      const std::vector<float> values = read_channel<float>(file, name, Imf::FLOAT);
      for (std::size_t i = 0; i < values.size(); ++i)
        ASSERT_EQ(values[i], layer.values[i * layer.channels.size() + c]) << name << ' ' << i;
    }
  }
  std::size_t in_file = 0;
  for (auto it = file.header().channels().begin(); it != file.header().channels().end(); ++it) ++in_file;
  EXPECT_EQ(in_file, channels);
}

TEST(Exr, viewers_find_the_layers_by_their_prefix) {
  const auto bytes = encode_exr(random_film(4, 4));
  MemoryInput stream(*bytes);
  const Imf::InputFile file(stream, 0);
  std::set<std::string> layers;
  file.header().channels().layers(layers);
  EXPECT_EQ(layers, (std::set<std::string>{"depth", "normal", "instance_id", "mesh_id", "primitive_id"}));
}

TEST(Exr, a_picture_without_colour_is_fine) {
  render::Film film = random_film(5, 3);
  film.layers.erase(film.layers.begin());
  EXPECT_TRUE(encode_exr(film).ok());
}

TEST(Exr, a_stopped_picture_is_none) {
  const render::Film film = random_film(70, 50);
  std::stop_source stop;
  EXPECT_EQ(encode_exr(film, stop.get_token()).value(), encode_exr(film).value());
  stop.request_stop();
  EXPECT_EQ(encode_exr(film, stop.get_token()).error().code, ErrorCode::kCancelled);
}

TEST(Exr, wrong_films_are_errors) {
  render::Film film = random_film(5, 3);
  film.layers[1].values.pop_back();
  EXPECT_EQ(encode_exr(film).error().code, ErrorCode::kInvalidArgument);
  film.layers.clear();
  EXPECT_EQ(encode_exr(film).error().code, ErrorCode::kInvalidArgument);
  film = random_film(5, 3);
  film.layers.push_back(film.layers[0]);  // the same channels twice
  EXPECT_EQ(encode_exr(film).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace gridcast::io
