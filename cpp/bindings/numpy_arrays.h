#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

// NumPy arrays by NumPy's own C interface, some 20 ns each: nb::ndarray and the buffer protocol
// take as long as the calls that the arrays are for. The functions are taken from NumPy at run
// time, by their places in its table, which are part of its binary interface since 1.0, so nothing
// of NumPy is needed to build.

namespace prehensile {

/// What is used of NumPy. Places and constants: numpy/_core/code_generators/numpy_api.py and
/// ndarraytypes.h.
struct NumpyApi {
  using Type = PyTypeObject;
  enum Dtype { kUint8 = 2, kInt32 = 5, kInt64 = 7, kFloat32 = 11, kFloat64 = 12 };
  enum Flags { kCContiguous = 0x1, kEnsureArray = 0x40, kAligned = 0x100, kNotSwapped = 0x200 };
  /// The head of every array object.
  struct Array {
    PyObject_HEAD char* data;
    int nd;
    Py_ssize_t* dimensions;
    Py_ssize_t* strides;
    PyObject* base;
    PyObject* descr;
    int flags;
  };

  PyTypeObject* array_type;
  PyObject* float64;
  PyObject* (*descr_from_type)(int);
  PyObject* (*from_any)(PyObject*, PyObject*, int, int, int, PyObject*);
  PyObject* (*empty)(int, const Py_ssize_t*, PyObject*, int);

  /// Once, while the module is loaded.
  static void Load() {
    nanobind::object module;
    try {
      module = nanobind::module_::import_("numpy._core.multiarray");
    } catch (const nanobind::python_error&) {  // NumPy 1.
      module = nanobind::module_::import_("numpy.core.multiarray");
    }
    const nanobind::object capsule = module.attr("_ARRAY_API");
    void** const table = static_cast<void**>(PyCapsule_GetPointer(capsule.ptr(), nullptr));
    if (!table) throw nanobind::python_error();
    NumpyApi& api = Mutable();
    api.array_type = static_cast<PyTypeObject*>(table[2]);
    api.descr_from_type = reinterpret_cast<decltype(api.descr_from_type)>(table[45]);
    api.from_any = reinterpret_cast<decltype(api.from_any)>(table[69]);
    api.empty = reinterpret_cast<decltype(api.empty)>(table[184]);
    api.float64 = api.descr_from_type(kFloat64);  // For as long as the process lives.
  }
  static const NumpyApi& Get() { return Mutable(); }

 private:
  static NumpyApi& Mutable() {
    static constinit NumpyApi api{};
    return api;
  }
};

/// Doubles in row-major order that an argument holds or can be turned into (lists, integers, other
/// strides).
class ArrayArgument {
 public:
  /// @param name of the argument, for messages.
  /// @throws std::invalid_argument if it cannot be an array of real numbers.
  ArrayArgument(nanobind::handle value, const char* name) : name_(name) {
    const NumpyApi& numpy = NumpyApi::Get();
    constexpr int kPlain = NumpyApi::kCContiguous | NumpyApi::kAligned;
    if (Py_TYPE(value.ptr()) == numpy.array_type) {
      object_ = nanobind::borrow(value);
      if (array()->descr == numpy.float64 && (array()->flags & kPlain) == kPlain) return;
    }
    Py_INCREF(numpy.float64);  // The call takes one away.
    object_ = nanobind::steal(
        numpy.from_any(value.ptr(), numpy.float64, 0, 0,
                       kPlain | NumpyApi::kNotSwapped | NumpyApi::kEnsureArray, nullptr));
    if (object_.is_valid()) return;
    const bool misfit =
        PyErr_ExceptionMatches(PyExc_TypeError) || PyErr_ExceptionMatches(PyExc_ValueError);
    if (!misfit) throw nanobind::python_error();
    PyErr_Clear();
    throw std::invalid_argument(Name() + ": expected an array of numbers");
  }
  ArrayArgument(const ArrayArgument&) = delete;
  ArrayArgument& operator=(const ArrayArgument&) = delete;

  const double* data() const { return reinterpret_cast<const double*>(array()->data); }
  const double* end() const { return data() + size(); }
  int ndim() const { return array()->nd; }
  std::size_t shape(int i) const { return static_cast<std::size_t>(array()->dimensions[i]); }
  std::size_t size() const {
    std::size_t product = 1;
    for (int i = 0; i < ndim(); ++i) product *= shape(i);
    return product;
  }
  /// A number of a vector.
  double operator[](std::size_t i) const { return data()[i]; }

  /// @param shape -1 where any size will do.
  /// @throws std::invalid_argument if the shape is another.
  void RequireShape(std::initializer_list<std::ptrdiff_t> shape) const {
    bool good = ndim() == static_cast<int>(shape.size());
    for (int i = 0; good && i < ndim(); ++i) {
      const std::ptrdiff_t size = shape.begin()[i];
      good = size < 0 || array()->dimensions[i] == size;
    }
    if (good) return;
    const Py_ssize_t* const got = array()->dimensions;
    throw std::invalid_argument(Name() + ": expected shape " +
                                Text(shape.begin(), static_cast<int>(shape.size())) + ", not " +
                                Text(got, ndim()));
  }

  /// @throws std::invalid_argument if a number is NaN, infinite, or so large that sums of a few
  ///     squares would not be finite.
  void RequireFinite() const {
    bool good = true;  // Looked at to the end: several at a time.
    for (const double* x = data(); x != end(); ++x) good &= std::abs(*x) <= 1e153;
    if (!good) throw std::invalid_argument(Name() + ": must be finite, and at most 1e153");
  }

  /// All of them as whole numbers.
  ///
  /// @throws std::invalid_argument if one is none.
  std::vector<int> Integers() const {
    std::vector<int> integers;
    for (const double* x = data(); x != end(); ++x) {
      if (!(std::abs(*x) <= 1e9) || *x != std::floor(*x)) {
        throw std::invalid_argument(Name() + ": expected whole numbers");
      }
      integers.push_back(static_cast<int>(*x));
    }
    return integers;
  }

 private:
  std::string Name() const { return name_; }
  const NumpyApi::Array* array() const {
    return reinterpret_cast<const NumpyApi::Array*>(object_.ptr());
  }
  static std::string Text(const std::ptrdiff_t* shape, int ndim) {
    std::string text;
    for (int i = 0; i < ndim; ++i) {
      text += (shape[i] < 0 ? "N" : std::to_string(shape[i])) + (i + 1 < ndim ? ", " : "");
    }
    return "(" + text + (ndim == 1 ? ",)" : ")");
  }

  const char* name_;
  nanobind::object object_;
};

/// n finite numbers.
class VectorArgument : public ArrayArgument {
 public:
  VectorArgument(nanobind::handle value, const char* name, std::ptrdiff_t n)
      : ArrayArgument(value, name) {
    RequireShape({n});
    RequireFinite();
  }
};

/// Rows of x, y, z, finite.
class RowsArgument : public ArrayArgument {
 public:
  /// @param n how many there must be; -1 for any number.
  RowsArgument(nanobind::handle value, const char* name, std::ptrdiff_t n = -1)
      : ArrayArgument(value, name) {
    RequireShape({n, 3});
    RequireFinite();
  }
};

/// A RigidTransform (whatever has GetAsMatrix4), or (4, 4).
class PoseArgument : public ArrayArgument {
 public:
  PoseArgument(nanobind::handle value, const char* name) : ArrayArgument(Matrix(value), name) {
    RequireShape({4, 4});
  }

 private:
  static nanobind::object Matrix(nanobind::handle value) {
    const bool is_array = Py_TYPE(value.ptr()) == NumpyApi::Get().array_type;
    if (is_array || !nanobind::hasattr(value, "GetAsMatrix4")) return nanobind::borrow(value);
    return value.attr("GetAsMatrix4")();
  }
};

/// A new NumPy array, not initialized.
template <typename T = double>
class ArrayResult {
 public:
  ArrayResult(std::initializer_list<std::size_t> shape) {
    constexpr int kDtype = std::is_same_v<T, double>         ? NumpyApi::kFloat64
                           : std::is_same_v<T, float>        ? NumpyApi::kFloat32
                           : std::is_same_v<T, std::int64_t> ? NumpyApi::kInt64
                           : std::is_same_v<T, std::int32_t> ? NumpyApi::kInt32
                                                             : NumpyApi::kUint8;
    static_assert(kDtype != NumpyApi::kUint8 || std::is_same_v<T, std::uint8_t>);
    const NumpyApi& numpy = NumpyApi::Get();
    Py_ssize_t sizes[4];
    std::copy(shape.begin(), shape.end(), sizes);
    // The call takes the description.
    array_ = nanobind::steal(
        numpy.empty(static_cast<int>(shape.size()), sizes, numpy.descr_from_type(kDtype), 0));
    if (!array_.is_valid()) throw nanobind::python_error();
  }
  /// A copy of so many values as the shape has.
  ArrayResult(std::initializer_list<std::size_t> shape, const T* values) : ArrayResult(shape) {
    std::size_t size = 1;
    for (const std::size_t s : shape) size *= s;
    std::copy_n(values, size, data());
  }

  T* data() { return reinterpret_cast<T*>(reinterpret_cast<NumpyApi::Array*>(array_.ptr())->data); }
  nanobind::object Take() { return std::move(array_); }

 private:
  nanobind::object array_;
};

}  // namespace prehensile
