// Pictures.
#include "bind.h"

#include <lambent/image/compare.h>
#include <lambent/image/image.h>

namespace lambent::python {
namespace {

ImageObject image_of_array(const py::array& given, const py::object& alpha) {
  if (given.ndim() != 3 || given.shape(2) != 3)
    throw Failure{
        {"array", "must have the shape (height, width, 3), not " + std::string(py::str(given.attr("shape"))), true}};
  const auto flat = vectors(given.attr("reshape")(-1, 3), "array");
  auto image = std::make_shared<Image>(int(given.shape(1)), int(given.shape(0)));
  image->rgb = flat;
  if (!alpha.is_none()) {
    const auto a = numbers(py::array(alpha).attr("ravel")(), "alpha", 0);
    if (size_t(a.size()) != flat.size()) throw Failure{{"alpha", "must have a value a pixel", true}};
    image->alpha.assign(a.data(), a.data() + a.size());
  }
  return {image};
}

py::object alpha_of(const ImageObject& o) {
  const Image& i = *o.image;
  if (i.alpha.empty()) return py::none();
  return view(i.alpha.data(), "float32", {i.height, i.width}, {}, o.image);
}

Display display_of(const Image& image, const std::string& exposure, const std::string& tone) {
  return take(parse_display(exposure, tone, {&image, 1}));
}

void save(const ImageObject& o, const std::filesystem::path& file, const std::string& exposure,
          const std::string& tone) {
  const std::string path = file.string();
  const bool png = file_extension(path) == "png";
  const Display display = png ? display_of(*o.image, exposure, tone) : Display();
  const Released released;
  take(save_image(path, *o.image, display));
}

py::bytes png_of(const ImageObject& o, const std::string& exposure, const std::string& tone) {
  const Display display = display_of(*o.image, exposure, tone);
  std::vector<uint8_t> bytes;
  {
    const Released released;
    bytes = take(encode_png(*o.image, display, "picture"));
  }
  return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

py::dict compare(const ImageObject& a, const ImageObject& b, const std::string& exposure, const std::string& tone,
                 bool all) {
  const Display display = display_of(*b.image, exposure, tone);
  ImageDifference d;
  {
    const Released released;
    d = take(compare_images(*a.image, *b.image, display, all));
  }
  py::dict out;
  out["pixels"] = d.pixels, out["rmse"] = d.rmse, out["relative_mse"] = d.relative_mse, out["psnr"] = d.psnr;
  out["flip"] = d.flip, out["mean_a"] = d.mean_a, out["mean_b"] = d.mean_b;
  return out;
}

ImageObject difference(const ImageObject& a, const ImageObject& b, const std::string& exposure,
                       const std::string& tone) {
  const Display display = display_of(*b.image, exposure, tone);
  const Released released;
  take(compare_images(*a.image, *b.image, display, true));  // whether they can be
  return {std::make_shared<Image>(difference_picture(*a.image, *b.image, display))};
}

}  // namespace

void bind_image(py::module_& m) {
  py::class_<ImageObject>(m, "Image", "A picture: linear Rec. 709 radiance, rows from the top, and coverage.")
      .def(py::init(&image_of_array), py::arg("array"), py::arg("alpha") = py::none(),
           "From an array (height, width, 3), premultiplied by `alpha` (height, width) where that is given.")
      .def_property_readonly(
          "array",
          [](const ImageObject& o) {
            return view(o.image->rgb.data(), "float32", {o.image->height, o.image->width, 3}, {}, o.image);
          },
          "float32 (height, width, 3), read-only, not copied.")
      .def_property_readonly("alpha", &alpha_of, "float32 (height, width), or None: all is covered.")
      .def_property_readonly("width", [](const ImageObject& o) { return o.image->width; })
      .def_property_readonly("height", [](const ImageObject& o) { return o.image->height; })
      .def("save", &save, py::arg("path"), py::arg("exposure") = "auto", py::arg("tone") = "neutral",
           "Writes .exr (radiance) or .png (as it is shown: exposure in stops or auto, tone neutral, agx, aces, none).")
      .def("png", &png_of, py::arg("exposure") = "auto", py::arg("tone") = "neutral", "The bytes of such a .png.")
      .def("_repr_png_", [](const ImageObject& o) { return png_of(o, "auto", "neutral"); });
  m.def(
      "load_image",
      [](const std::filesystem::path& path) {
        const Released released;
        return ImageObject{std::make_shared<Image>(take(load_image(path.string())))};
      },
      py::arg("path"), "Reads .exr, .hdr, .png or .jpg; linear.");
  m.def("compare", &compare, py::arg("a"), py::arg("b"), py::arg("exposure") = "0", py::arg("tone") = "none",
        py::arg("all") = false);
  m.def("difference", &difference, py::arg("a"), py::arg("b"), py::arg("exposure") = "0", py::arg("tone") = "none");
}

}  // namespace lambent::python
