#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <png.h>

#include "core/io/image.h"
#include "core/math/vec.h"

namespace gridcast::io {
namespace {

using Rgb = std::array<int, 3>;

struct Picture {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> rgb;
  [[nodiscard]] Rgb at(std::size_t pixel) const {
    return {rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2]};
  }
};

Picture decode(const std::vector<std::byte>& bytes) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()), 0) << image.message;
  EXPECT_EQ(image.format, png_uint_32(PNG_FORMAT_RGB));
  image.format = PNG_FORMAT_RGB;
  Picture picture{int(image.width), int(image.height), std::vector<std::uint8_t>(PNG_IMAGE_SIZE(image))};
  EXPECT_NE(png_image_finish_read(&image, nullptr, picture.rgb.data(), 0, nullptr), 0) << image.message;
  return picture;
}

Picture encoded(const render::Film& film) {
  const auto bytes = encode_png(film, film.layers[0]);
  EXPECT_TRUE(bytes.ok());
  return decode(*bytes);
}

render::Film film_of(int width_px, int height_px, render::Layer layer) {
  render::Film film;
  film.width_px = width_px;
  film.height_px = height_px;
  film.layers.push_back(std::move(layer));
  return film;
}

render::Layer color(render::Samples<float> values) {
  return {"color", {"R", "G", "B", "A"}, std::move(values), {}};
}

TEST(Png, colours_become_srgb_codes_from_the_top_row) {
  const Picture picture = encoded(film_of(1, 2, color({0.F, 0.25F, 0.5F, 1.F, 0.001F, -1.F, 0.75F, 0.F})));
  EXPECT_EQ(picture.width_px, 1);
  EXPECT_EQ(picture.height_px, 2);
  // Codes of IEC 61966-2-1: 0.25 -> 137, 0.5 -> 188, 0.001 -> 3, 0.75 -> 225; alpha changes nothing.
  EXPECT_EQ(picture.at(0), (Rgb{0, 137, 188}));
  EXPECT_EQ(picture.at(1), (Rgb{3, 0, 225}));
}

TEST(Png, highlights_stay_ordered_and_reach_white) {
  const Picture picture = encoded(film_of(
      4, 1, color({1.F, 1.F, 1.F, 1.F, 2.F, 2.F, 2.F, 1.F, 8.F, 8.F, 8.F, 1.F, 1e9F, 1e9F, 1e9F, 1.F})));
  EXPECT_LT(picture.at(0)[0], picture.at(1)[0]);
  EXPECT_LT(picture.at(1)[0], picture.at(2)[0]);
  EXPECT_EQ(picture.at(3)[0], 255);
}

TEST(Png, the_exposure_of_the_film_is_applied) {
  render::Film film = film_of(1, 1, color({1000.F, 500.F, 0.F, 1.F}));
  film.exposure = 0.0005F;
  EXPECT_EQ(encoded(film).at(0), (Rgb{188, 137, 0}));
}

TEST(Png, values_that_are_not_numbers_are_black_and_infinite_ones_white) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(encoded(film_of(1, 1, color({nan, inf, -inf, 1.F}))).at(0), (Rgb{0, 255, 0}));
}

TEST(Png, depth_is_white_near_dark_far_and_black_where_nothing_is) {
  const float inf = std::numeric_limits<float>::infinity();
  const Picture picture = encoded(film_of(4, 1, {"depth", {"Z"}, {2.F, 4.F, 3.F, inf}, {}}));
  EXPECT_EQ(picture.at(0)[0], 255);
  EXPECT_EQ(picture.at(1)[0], 26);
  EXPECT_EQ(picture.at(2)[0], 140);
  EXPECT_EQ(picture.at(3)[0], 0);
}

TEST(Png, a_flat_or_empty_depth_picture_does_not_divide_by_zero) {
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(encoded(film_of(2, 1, {"depth", {"Z"}, {2.F, 2.F}, {}})).at(1)[0], 255);
  EXPECT_EQ(encoded(film_of(2, 1, {"depth", {"Z"}, {inf, inf}, {}})).at(1)[0], 0);
}

TEST(Png, normals_map_to_the_full_range) {
  const Picture picture =
      encoded(film_of(2, 1, {"normal", {"X", "Y", "Z"}, {-1.F, 0.F, 1.F, 0.F, 1.F, 0.F}, {}}));
  EXPECT_EQ(picture.at(0), (Rgb{0, 128, 255}));
  EXPECT_EQ(picture.at(1), (Rgb{128, 255, 128}));
}

TEST(Png, ids_have_stable_colours_and_the_background_is_black) {
  const Picture picture = encoded(film_of(4, 1, {"instance_id", {"id"}, {}, {7, 8, 7, kInvalidId}}));
  EXPECT_EQ(picture.at(0), picture.at(2));
  EXPECT_NE(picture.at(0), picture.at(1));
  EXPECT_EQ(picture.at(3), (Rgb{0, 0, 0}));
  for (const int value : picture.at(0)) EXPECT_GE(value, 64);
}

TEST(Png, a_stopped_picture_is_none) {
  const render::Film film =
      film_of(300, 200, color(render::Samples<float>(std::size_t(4) * 300 * 200, 0.5F)));
  std::stop_source stop;
  EXPECT_EQ(encode_png(film, film.layers[0], stop.get_token()).value(),
            encode_png(film, film.layers[0]).value());
  stop.request_stop();
  EXPECT_EQ(encode_png(film, film.layers[0], stop.get_token()).error().code, ErrorCode::kCancelled);
}

TEST(Png, layers_of_the_wrong_size_are_errors) {
  for (render::Film film :
       {film_of(2, 1, color({0, 0, 0, 1})), film_of(0, 1, color({})), film_of(1, 1, {"depth", {}, {}, {}}),
        film_of(2, 1, {"instance_id", {"id"}, {}, {7}}), film_of(1, 1, {"pair", {"U", "V"}, {0, 0}, {}})}) {
    const auto bytes = encode_png(film, film.layers[0]);
    ASSERT_FALSE(bytes.ok());
    EXPECT_EQ(bytes.error().code, ErrorCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace gridcast::io
