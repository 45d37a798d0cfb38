#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <stdexcept>
#include <string>

// NumPy arrays of doubles by the buffer protocol: some 0.2 µs each, which nb::ndarray is not.
// For calls that take a microsecond themselves.

namespace prehensile {

/// Doubles in row-major order that an argument holds or can be turned into (lists, integers).
class ArrayArgument {
 public:
  /// @param name of the argument, for messages.
  /// @throws std::invalid_argument if it cannot be an array of numbers.
  ArrayArgument(nanobind::handle value, const char* name) : name_(name) {
    if (!Open(value)) {
      PyErr_Clear();
      try {
        converted_ =
            nanobind::module_::import_("numpy").attr("ascontiguousarray")(value, "float64");
      } catch (const nanobind::python_error&) {
        throw std::invalid_argument(Name() + ": expected an array of numbers");
      }
      if (!Open(converted_)) throw std::invalid_argument(Name() + ": expected an array of numbers");
    }
  }
  ~ArrayArgument() {
    if (open_) PyBuffer_Release(&view_);
  }
  ArrayArgument(const ArrayArgument&) = delete;
  ArrayArgument& operator=(const ArrayArgument&) = delete;

  const double* data() const { return static_cast<const double*>(view_.buf); }
  std::size_t size() const { return static_cast<std::size_t>(view_.len) / sizeof(double); }
  int ndim() const { return view_.ndim; }
  std::size_t shape(int i) const { return static_cast<std::size_t>(view_.shape[i]); }

  /// @param shape -1 where any size will do.
  /// @throws std::invalid_argument if the shape is another.
  void RequireShape(std::initializer_list<std::ptrdiff_t> shape) const {
    bool good = ndim() == static_cast<int>(shape.size());
    int i = 0;
    std::string text;
    for (const std::ptrdiff_t size : shape) {
      good = good && (size < 0 || view_.shape[i] == size);
      ++i;
    }
    if (good) return;
    for (const std::ptrdiff_t size : shape) text += (size < 0 ? "N" : std::to_string(size)) + ", ";
    std::string got;
    for (int k = 0; k < ndim(); ++k) got += std::to_string(view_.shape[k]) + ", ";
    throw std::invalid_argument(Name() + ": expected shape (" + text.substr(0, text.size() - 2) +
                                "), not (" + (got.empty() ? got : got.substr(0, got.size() - 2)) +
                                ")");
  }

  /// @throws std::invalid_argument if a number is NaN or infinite.
  void RequireFinite() const {
    double sum = 0;  // 0 · x is NaN exactly where x is not finite.
    for (std::size_t i = 0; i < size(); ++i) sum += 0.0 * data()[i];
    if (sum != 0) throw std::invalid_argument(Name() + ": must be finite");
  }

 private:
  std::string Name() const { return name_; }

  bool Open(nanobind::handle value) {
    if (PyObject_GetBuffer(value.ptr(), &view_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) != 0) {
      return false;
    }
    open_ = view_.format && view_.format[0] == 'd' && view_.format[1] == 0;
    if (!open_) PyBuffer_Release(&view_);
    return open_;
  }

  const char* name_;
  nanobind::object converted_;
  Py_buffer view_;
  bool open_ = false;
};

/// A new NumPy array of doubles, not initialized.
class ArrayResult {
 public:
  ArrayResult(std::initializer_list<std::size_t> shape) {
    // Never freed: it would be after the interpreter.
    static PyObject* const empty =
        nanobind::object(nanobind::module_::import_("numpy").attr("empty")).release().ptr();
    PyObject* sizes = PyTuple_New(static_cast<Py_ssize_t>(shape.size()));
    Py_ssize_t i = 0;
    for (const std::size_t size : shape) PyTuple_SET_ITEM(sizes, i++, PyLong_FromSize_t(size));
    array_ = nanobind::steal(PyObject_CallOneArg(empty, sizes));
    Py_DECREF(sizes);
    if (!array_.is_valid()) throw nanobind::python_error();
    Py_buffer view;
    if (PyObject_GetBuffer(array_.ptr(), &view, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE) != 0) {
      throw nanobind::python_error();
    }
    data_ = static_cast<double*>(view.buf);
    PyBuffer_Release(&view);  // The array owns the memory and cannot be resized while we hold it.
  }

  double* data() { return data_; }
  nanobind::object Take() { return std::move(array_); }

 private:
  nanobind::object array_;
  double* data_ = nullptr;
};

}  // namespace prehensile
