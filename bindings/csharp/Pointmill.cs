// pointmill for C#: one file, for Unity projects and any other program (C# 7.3, .NET Standard 2.0, no reference to Unity).
//
// It calls the library of crates/capi: put pointmill.dll, libpointmill.so or libpointmill.dylib where the program finds it (Unity:
// Assets/Plugins). pointmill.h says everything in more detail; names here are those without pm_.
//
// - Errors are exceptions of the type PointmillException, with the line that says what, where and what to do.
// - A Dataset can be used by several threads at once; give each thread its own Points.
// - Arrays are pinned, not copied, while the library fills them.
// - World coordinates are in the axes of the dataset: Axes.YUpLeftHanded for Unity.

using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Pointmill
{
    /// <summary>How a call ended; see PmStatus.</summary>
    public enum Status : uint
    {
        Ok = 0, Internal = 1, Argument = 2, Broken = 3, Unsupported = 4, Io = 5, Memory = 6, Buffer = 8, Missing = 9, Version = 10
    }

    /// <summary>The axes of all that a dataset takes and gives. Of a dataset with (x, y, z): see each.</summary>
    public enum Axes : uint
    {
        /// <summary>(x, y, z): as in the file, right-handed.</summary>
        ZUp = 0,
        /// <summary>(x, z, -y): right-handed.</summary>
        YUp = 1,
        /// <summary>(x, z, y): left-handed, as Unity.</summary>
        YUpLeftHanded = 2
    }

    /// <summary>The kinds of datasets.</summary>
    public enum Kind : uint { Potree2 = 1, Potree1 = 2, Copc = 3, Bintree = 4, Batches = 5 }

    /// <summary>The type of an element of an attribute.</summary>
    public enum ElementType : uint
    {
        Int8 = 0, UInt8 = 1, Int16 = 2, UInt16 = 3, Int32 = 4, UInt32 = 5, Int64 = 6, UInt64 = 7, Float32 = 8, Float64 = 9
    }

    /// <summary>Which octree nodes come first.</summary>
    public enum Order : uint { Radius = 0, RadiusAndAngle = 1 }

    /// <summary>How the points of a leaf of a binary tree are drawn.</summary>
    public enum Material : uint { None = 0, Far = 1, Near = 2, Both = 3 }

    /// <summary>Sections of quantised batches.</summary>
    public enum Section : uint { Records = 0, Hi10 = 1, Mid10 = 2, Lo10 = 3, Colour = 4, Attribute = 5 }

    /// <summary>What a node is.</summary>
    [Flags]
    public enum NodeFlags : uint { None = 0, Proxy = 1, Leaf = 2, Drawable = 4 }

    /// <summary>Three doubles: x, y, z.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector3d
    {
        public double X, Y, Z;

        public Vector3d(double x, double y, double z) { X = x; Y = y; Z = z; }
    }

    /// <summary>The least and the greatest coordinates, world units.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Box
    {
        public Vector3d Min, Max;
    }

    /// <summary>What is known without reading points; see PmInfo.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Info
    {
        public Kind Kind;
        private uint hasPoints;
        /// <summary>0 if the dataset does not say it.</summary>
        public ulong Points;
        /// <summary>Nodes that are known now.</summary>
        public uint Nodes;
        public uint Attributes;
        /// <summary>Of an octree the cube.</summary>
        public Box Bounds;
        /// <summary>The box of the points where it is known, else Bounds.</summary>
        public Box Tight;
        private uint hasTight;
        private uint hasColours;
        /// <summary>Octrees: distance between points in the root, world units; halves with every level.</summary>
        public double Spacing;
        /// <summary>In the axes of the file, as Offset, GridOrigin.</summary>
        public Vector3d Scale, Offset;
        /// <summary>Most points of a node; 0: no limit.</summary>
        public ulong NodeCapacity;
        /// <summary>Batches: bits of a position.</summary>
        public uint Bits;
        private uint isCompressed;
        public Vector3d GridOrigin;
        public double GridCell;

        public bool HasPoints { get { return hasPoints != 0; } }
        public bool HasTight { get { return hasTight != 0; } }
        public bool HasColours { get { return hasColours != 0; } }
        public bool IsCompressed { get { return isCompressed != 0; } }
    }

    /// <summary>A node; see PmNode.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Node
    {
        /// <summary>Parent of a root, and of batches.</summary>
        public const uint NoNode = uint.MaxValue;

        public uint Id, Parent, Level;
        public NodeFlags Flags;
        /// <summary>Its own; of an inner node of a binary tree those of its leaves.</summary>
        public ulong Points;
        public Box Bounds;
        public double Spacing;
        /// <summary>An origin for positions in single precision, and the place of the node's mesh.</summary>
        public Vector3d Center;
    }

    /// <summary>A perspective camera, in the axes of the dataset; see PmCamera.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Camera
    {
        public Vector3d Eye, Forward, Up;
        /// <summary>Radians.</summary>
        public double VerticalFov;
        /// <summary>World units; Far 0: no limit.</summary>
        public double Near, Far;
        /// <summary>Pixels.</summary>
        public uint Width, Height;
    }

    /// <summary>How much a picture shows; see PmSelection.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Selection
    {
        public ulong Budget;
        public double MinNodePixels;
        /// <summary>Binary trees: world units, greater than 0.</summary>
        public double PointRadius;
        public Order Order;
        private uint load;

        /// <summary>Octrees: reads chunks of the hierarchy as they are needed.</summary>
        public bool Load { get { return load != 0; } set { load = value ? 1u : 0u; } }
    }

    /// <summary>A node to draw; see PmDraw.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Draw
    {
        public uint Node, Parent;
        public NodeFlags Flags;
        public Material Material;
        public uint Bits;
        private uint reserved;
        public ulong Points;
        public double DMin, DMax, Pixels;
    }

    /// <summary>A ray with a width: Radius + Spread · distance.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Ray
    {
        public Vector3d Origin, Direction;
        public double Radius, Spread;
    }

    /// <summary>A point that a ray met; see PmHit.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Hit
    {
        public Vector3d Position;
        public double Distance, OffRay;
        /// <summary>Number among the points of the node.</summary>
        public ulong Point;
        public uint Node;
        private uint found;

        public bool Found { get { return found != 0; } }
    }

    /// <summary>A batch as it is in the file: 32 bytes, in the axes of the file, relative to Info.GridOrigin.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct BatchRecord
    {
        public float MinX, MinY, MinZ;
        public uint FirstPoint;
        public float MaxX, MaxY, MaxZ;
        public uint Points;
    }

    /// <summary>What a validation found; see PmValidation.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Validation
    {
        private uint ok, reserved;
        public ulong FailedChecks, Errors, Warnings, Points, Nodes;

        public bool Ok { get { return ok != 0; } }
    }

    /// <summary>An attribute; positions are not among them.</summary>
    public sealed class AttributeInfo
    {
        public string Name { get; internal set; }
        public ElementType Type { get; internal set; }
        public int Elements { get; internal set; }
        /// <summary>Bytes per point.</summary>
        public int Size { get; internal set; }
        /// <summary>Raw, by element; null where the dataset does not say it. So is Max.</summary>
        public double[] Min { get; internal set; }
        public double[] Max { get; internal set; }
        /// <summary>Meant values are raw · Scale + Offset.</summary>
        public double[] Scale { get; internal set; }
        public double[] Offset { get; internal set; }
    }

    /// <summary>A call that did not succeed. Message: one line that says what, where and what to do.</summary>
    public sealed class PointmillException : Exception
    {
        public Status Status { get; private set; }

        public PointmillException(Status status, string message) : base(message) { Status = status; }
    }

    /// <summary>A dataset that is open.</summary>
    public sealed class Dataset : IDisposable
    {
        internal readonly DatasetHandle Handle;

        /// <summary>The attributes; the index of one is what Points takes.</summary>
        public AttributeInfo[] Attributes { get; private set; }

        public Axes Axes { get; private set; }

        private Dataset(DatasetHandle handle, Axes axes)
        {
            Handle = handle;
            Axes = axes;
            Attributes = new AttributeInfo[Info.Attributes];
            for (int i = 0; i < Attributes.Length; i++) Attributes[i] = Attribute((uint)i);
        }

        /// <summary>Opens a folder, its marker file, a .qbatch file, a COPC file or an archive; the kind is detected.</summary>
        public static Dataset Open(string path, Axes axes = Axes.YUpLeftHanded)
        {
            DatasetHandle handle;
            Native.Check(Native.pm_open(Native.ApiVersion, Native.Utf8(path), axes, out handle));
            return new Dataset(handle, axes);
        }

        /// <summary>Closes it, as soon as no call and no mapped section uses it any more.</summary>
        public void Dispose() { Handle.Dispose(); }

        public Info Info
        {
            get
            {
                Info info;
                Native.Check(Native.pm_info(Handle, out info));
                return info;
            }
        }

        /// <summary>For people: "Potree 2.0".</summary>
        public string Format { get { return Kept(Native.Text(Native.pm_format(Handle))); } }

        /// <summary>The coordinate reference system: mostly a proj4 definition; empty if the dataset names none.</summary>
        public string Projection { get { return Kept(Native.Text(Native.pm_projection(Handle))); } }

        public Node Node(uint id)
        {
            Node node;
            Native.Check(Native.pm_node(Handle, id, out node));
            return node;
        }

        /// <summary>All nodes that are known now, by number.</summary>
        public Node[] Nodes()
        {
            Node[] nodes = new Node[Info.Nodes];
            Native.Check(Native.pm_nodes(Handle, 0, (uint)nodes.Length, nodes));
            return nodes;
        }

        /// <summary>Fills children, which has room for 8; returns how many there are.</summary>
        public int Children(uint id, uint[] children)
        {
            if (children == null || children.Length < 8) throw new ArgumentException("there have to be 8", "children");
            uint count;
            Native.Check(Native.pm_children(Handle, id, children, out count));
            return (int)count;
        }

        /// <summary>"r042", "n0101", "7".</summary>
        public string Name(uint id)
        {
            byte[] name = new byte[520];
            Native.Check(Native.pm_node_name(Handle, id, name, Native.Size(name.Length)));
            return Native.Text(name);
        }

        /// <summary>Octrees: reads the chunk of a proxy; returns how many nodes became known. Reads from the disk.</summary>
        public uint Load(uint id)
        {
            uint added;
            Native.Check(Native.pm_load(Handle, id, out added));
            return added;
        }

        /// <summary>Octrees: reads all of the hierarchy.</summary>
        public void LoadAll(uint mostNodes) { Native.Check(Native.pm_load_all(Handle, mostNodes)); }

        /// <summary>D_min and D_max: from eye to the nearest point of the node's box, and to its farthest corner.</summary>
        public void Distances(uint id, Vector3d eye, out double dMin, out double dMax)
        {
            Native.Check(Native.pm_distances(Handle, id, ref eye, out dMin, out dMax));
        }

        /// <summary>What a picture shows; list grows where it is too small. Returns how many of it are filled.</summary>
        public int Select(ref Camera camera, ref Selection selection, ref Draw[] list)
        {
            if (list == null) list = new Draw[64];
            while (true)
            {
                UIntPtr count;
                Status status = Native.pm_select(Handle, ref camera, ref selection, list, Native.Size(list.Length), out count);
                if (status != Status.Buffer)
                {
                    Native.Check(status);
                    return (int)count;
                }
                list = new Draw[(int)count + (int)count / 4];
            }
        }

        /// <summary>The point that the ray meets first; Hit.Found says whether there is one.</summary>
        public Hit Pick(Ray ray)
        {
            Hit hit;
            Native.Check(Native.pm_pick(Handle, ref ray, out hit));
            return hit;
        }

        /// <summary>A section of quantised batches in the mapped file, without a copy; to be disposed. Not of compressed files.</summary>
        public MappedSection MapSection(Section section, int attribute = 0)
        {
            return new MappedSection(Handle, section, attribute);
        }

        /// <summary>The values of one batch, of compressed files too; returns how many bytes of out are filled.</summary>
        public int ReadBatchSection(uint slot, Section section, int attribute, byte[] bytes)
        {
            UIntPtr count;
            Native.Check(Native.pm_batch_section(
                Handle, slot, section, (uint)attribute, bytes, Native.Size(Native.Length(bytes)), out count));
            return (int)count;
        }

        private AttributeInfo Attribute(uint index)
        {
            Native.AttributeData data;
            Native.Check(Native.pm_attribute(Handle, index, out data));
            int elements = (int)data.Elements;
            return Kept(new AttributeInfo
            {
                Name = Native.Text(data.Name),
                Type = data.Type,
                Elements = elements,
                Size = (int)data.Size,
                Min = Native.Doubles(data.Min, elements),
                Max = Native.Doubles(data.Max, elements),
                Scale = Native.Doubles(data.Scale, elements),
                Offset = Native.Doubles(data.Offset, elements)
            });
        }

        /// <summary>What was copied from memory of the handle, which must not be collected before.</summary>
        private T Kept<T>(T copied)
        {
            GC.KeepAlive(this);
            return copied;
        }
    }

    /// <summary>Memory of the mapped file, to be read only. Keeps the dataset open until it is disposed.</summary>
    public sealed class MappedSection : IDisposable
    {
        private DatasetHandle handle;

        public IntPtr Pointer { get; private set; }
        public long Bytes { get; private set; }

        internal MappedSection(DatasetHandle handle, Section section, int attribute)
        {
            IntPtr data;
            UIntPtr bytes;
            bool isKept = false;
            handle.DangerousAddRef(ref isKept);
            Status status = Native.pm_section(handle, section, (uint)attribute, out data, out bytes);
            if (status != Status.Ok)
            {
                PointmillException error = Native.Error(status);
                handle.DangerousRelease();
                throw error;
            }
            this.handle = handle;
            Pointer = data;
            Bytes = (long)bytes;
        }

        /// <summary>Copies 32-bit words from number first on.</summary>
        public void CopyWords(long first, int[] words, int start, int count)
        {
            if (handle == null) throw new ObjectDisposedException("MappedSection");
            if (first < 0 || count < 0 || first > Bytes / 4 - count) throw new ArgumentOutOfRangeException("first");
            Marshal.Copy(new IntPtr(Pointer.ToInt64() + 4 * first), words, start, count);
        }

        public void Dispose()
        {
            DatasetHandle kept = handle;
            handle = null;
            Pointer = IntPtr.Zero;
            Bytes = 0;
            if (kept != null) kept.DangerousRelease();
            GC.SuppressFinalize(this);
        }

        ~MappedSection() { Dispose(); }
    }

    /// <summary>The points of one node, decoded; used for node after node. One for each thread.</summary>
    public sealed class Points : IDisposable
    {
        /// <summary>Most vertices of a mesh with indices of 16 bits: windows of as many points.</summary>
        public const int MeshVertices = 65000;

        private readonly PointsHandle handle;

        public int Count { get; private set; }

        public Points() { Native.Check(Native.pm_points_new(out handle)); }

        public void Dispose() { handle.Dispose(); }

        /// <summary>Decodes a node in place of what is there; returns how many points it has. bits: of batches, 0 for all.</summary>
        public int Decode(Dataset dataset, uint node, int bits = 0)
        {
            UIntPtr count;
            Count = 0;
            Native.Check(Native.pm_decode(dataset.Handle, node, (uint)bits, handle, out count));
            return Count = checked((int)count);
        }

        /// <summary>x, y, z of count points from number first on, relative to origin.</summary>
        public void Positions(int first, int count, Vector3d origin, float[] xyz)
        {
            Native.Check(Native.pm_points_positions(
                handle, Native.Size(first), Native.Size(count), ref origin, xyz, Native.Size(Native.Length(xyz))));
        }

        /// <summary>x, y, z in double precision, relative to nothing.</summary>
        public void World(int first, int count, double[] xyz)
        {
            Native.Check(Native.pm_points_world(
                handle, Native.Size(first), Native.Size(count), xyz, Native.Size(Native.Length(xyz))));
        }

        /// <summary>Red, green, blue, alpha: Color32 of Unity.</summary>
        public void Colours(int first, int count, byte[] rgba)
        {
            Native.Check(Native.pm_points_colours(
                handle, Native.Size(first), Native.Size(count), rgba, Native.Size(Native.Length(rgba))));
        }

        /// <summary>Raw values of an attribute: AttributeInfo.Size bytes per point, little-endian.</summary>
        public void Attribute(int attribute, int first, int count, byte[] raw)
        {
            Native.Check(Native.pm_points_attribute(
                handle, (uint)attribute, Native.Size(first), Native.Size(count), raw, Native.Size(Native.Length(raw))));
        }

        /// <summary>Meant values of an attribute: AttributeInfo.Elements per point.</summary>
        public void Values(int attribute, int first, int count, double[] values)
        {
            Native.Check(Native.pm_points_values(
                handle, (uint)attribute, Native.Size(first), Native.Size(count), values, Native.Size(Native.Length(values))));
        }
    }

    /// <summary>What needs no open dataset.</summary>
    public static class Library
    {
        /// <summary>"0.1.0"</summary>
        public static string Version { get { return Native.Text(Native.pm_version()); } }

        /// <summary>Checks a dataset; message is the first finding, or empty. threads 0: one per core; memoryBytes 0: 4 GiB.</summary>
        public static Validation Validate(string path, out string message, int threads = 0, ulong memoryBytes = 0)
        {
            Validation result;
            byte[] text = new byte[1024];
            Native.Check(Native.pm_validate(
                Native.Utf8(path), (uint)threads, memoryBytes, out result, text, Native.Size(text.Length)));
            message = Native.Text(text);
            return result;
        }

        /// <summary>Where points change from discs to single pixels; world units, radians, pixels.</summary>
        public static double SwitchDistance(double pointRadius, double verticalFov, double height)
        {
            double distance;
            Native.Check(Native.pm_switch_distance(pointRadius, verticalFov, height, out distance));
            return distance;
        }

        /// <summary>Batches: the weight of the point with that storage index; see pm_clod_weight.</summary>
        public static float ClodWeight(uint index) { return Native.pm_clod_weight(index); }

        /// <summary>Batches: the spacing that the picture wants of points; see pm_clod_spacing.</summary>
        public static float ClodSpacing(float distance, float clod, float ndcRadius)
        {
            return Native.pm_clod_spacing(distance, clod, ndcRadius);
        }

        /// <summary>Batches: whether a point of that level and weight is drawn; see pm_clod_keeps.</summary>
        public static bool ClodKeeps(uint level, float weight, float cell, float spacing)
        {
            return Native.pm_clod_keeps(level, weight, cell, spacing) != 0;
        }

        /// <summary>Batches: how many levels of a batch that is dMin away can be seen, 0 to 4.</summary>
        public static int ClodLevels(double dMin, float clod, float cell)
        {
            return (int)Native.pm_clod_levels(dMin, clod, cell);
        }

        /// <summary>The material of a box between dMin and dMax.</summary>
        public static Material Material(double dMin, double dMax, double switchDistance)
        {
            return Native.pm_material(dMin, dMax, switchDistance);
        }
    }

    internal sealed class DatasetHandle : SafeHandle
    {
        private DatasetHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid { get { return handle == IntPtr.Zero; } }

        protected override bool ReleaseHandle()
        {
            Native.pm_close(handle);
            return true;
        }
    }

    internal sealed class PointsHandle : SafeHandle
    {
        private PointsHandle() : base(IntPtr.Zero, true) { }

        public override bool IsInvalid { get { return handle == IntPtr.Zero; } }

        protected override bool ReleaseHandle()
        {
            Native.pm_points_free(handle);
            return true;
        }
    }

    /// <summary>The functions of pointmill.h.</summary>
    internal static class Native
    {
#if UNITY_IOS && !UNITY_EDITOR
        private const string Lib = "__Internal";
#else
        private const string Lib = "pointmill";
#endif
        private const CallingConvention C = CallingConvention.Cdecl;

        internal const uint ApiVersion = 1000;

        [StructLayout(LayoutKind.Sequential)]
        internal struct AttributeData
        {
            public IntPtr Name;
            public ElementType Type;
            public uint Elements, Size, Reserved;
            public IntPtr Min, Max, Scale, Offset;
        }

        internal static void Check(Status status)
        {
            if (status != Status.Ok) throw Error(status);
        }

        internal static PointmillException Error(Status status)
        {
            return new PointmillException(status, Text(pm_last_error()));
        }

        internal static UIntPtr Size(int value)
        {
            if (value < 0) throw new ArgumentOutOfRangeException("value");
            return new UIntPtr((uint)value);
        }

        internal static int Length(Array array) { return array == null ? 0 : array.Length; }

        internal static byte[] Utf8(string text)
        {
            if (text == null) throw new ArgumentNullException("text");
            return Encoding.UTF8.GetBytes(text + "\0");
        }

        internal static string Text(byte[] bytes)
        {
            int end = Array.IndexOf(bytes, (byte)0);
            return Encoding.UTF8.GetString(bytes, 0, end < 0 ? bytes.Length : end);
        }

        internal static string Text(IntPtr text)
        {
            if (text == IntPtr.Zero) return "";
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) length++;
            byte[] bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }

        internal static double[] Doubles(IntPtr values, int count)
        {
            if (values == IntPtr.Zero) return null;
            double[] copy = new double[count];
            Marshal.Copy(values, copy, 0, count);
            return copy;
        }

        [DllImport(Lib, CallingConvention = C)] internal static extern IntPtr pm_last_error();
        [DllImport(Lib, CallingConvention = C)] internal static extern IntPtr pm_version();
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_open(
            uint apiVersion, [In] byte[] path, Axes axes, out DatasetHandle dataset);
        [DllImport(Lib, CallingConvention = C)] internal static extern void pm_close(IntPtr dataset);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_info(DatasetHandle dataset, out Info info);
        [DllImport(Lib, CallingConvention = C)] internal static extern IntPtr pm_format(DatasetHandle dataset);
        [DllImport(Lib, CallingConvention = C)] internal static extern IntPtr pm_projection(DatasetHandle dataset);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_attribute(
            DatasetHandle dataset, uint index, out AttributeData attribute);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_node(
            DatasetHandle dataset, uint id, out Node node);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_nodes(
            DatasetHandle dataset, uint first, uint count, [Out] Node[] nodes);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_children(
            DatasetHandle dataset, uint id, [Out] uint[] children, out uint count);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_node_name(
            DatasetHandle dataset, uint id, [Out] byte[] name, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_load(
            DatasetHandle dataset, uint id, out uint added);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_load_all(DatasetHandle dataset, uint mostNodes);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_distances(
            DatasetHandle dataset, uint id, ref Vector3d eye, out double dMin, out double dMax);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_select(
            DatasetHandle dataset, ref Camera camera, ref Selection selection, [Out] Draw[] list, UIntPtr capacity,
            out UIntPtr count);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_switch_distance(
            double pointRadius, double verticalFov, double height, out double distance);
        [DllImport(Lib, CallingConvention = C)] internal static extern Material pm_material(
            double dMin, double dMax, double switchDistance);
        [DllImport(Lib, CallingConvention = C)] internal static extern float pm_clod_weight(uint index);
        [DllImport(Lib, CallingConvention = C)] internal static extern float pm_clod_spacing(
            float distance, float clod, float ndcRadius);
        [DllImport(Lib, CallingConvention = C)] internal static extern uint pm_clod_keeps(
            uint level, float weight, float cell, float spacing);
        [DllImport(Lib, CallingConvention = C)] internal static extern uint pm_clod_levels(
            double dMin, float clod, float cell);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_pick(
            DatasetHandle dataset, ref Ray ray, out Hit hit);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_section(
            DatasetHandle dataset, Section section, uint attribute, out IntPtr data, out UIntPtr bytes);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_batch_section(
            DatasetHandle dataset, uint slot, Section section, uint attribute, [Out] byte[] bytes, UIntPtr capacity,
            out UIntPtr count);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_validate(
            [In] byte[] path, uint threads, ulong memoryBytes, out Validation result, [Out] byte[] message, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_new(out PointsHandle points);
        [DllImport(Lib, CallingConvention = C)] internal static extern void pm_points_free(IntPtr points);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_decode(
            DatasetHandle dataset, uint id, uint bits, PointsHandle points, out UIntPtr count);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_positions(
            PointsHandle points, UIntPtr first, UIntPtr count, ref Vector3d origin, [Out] float[] xyz, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_world(
            PointsHandle points, UIntPtr first, UIntPtr count, [Out] double[] xyz, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_colours(
            PointsHandle points, UIntPtr first, UIntPtr count, [Out] byte[] rgba, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_attribute(
            PointsHandle points, uint attribute, UIntPtr first, UIntPtr count, [Out] byte[] raw, UIntPtr capacity);
        [DllImport(Lib, CallingConvention = C)] internal static extern Status pm_points_values(
            PointsHandle points, uint attribute, UIntPtr first, UIntPtr count, [Out] double[] values, UIntPtr capacity);
    }
}
